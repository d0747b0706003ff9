//! Spectral tables at 400, 410, ... 700 nm.
//!
//! Leaf: refractive index and specific absorptions of PROSPECT-5 [Feret 2008], as carried under
//! the MIT licence by the package rrtm (Alexey Shiklomanov). Light and eye: CIE 1931 2-degree
//! colour matching functions and relative power of the illuminant D65 [CIE 015:2018].

/// Number of wavelengths.
pub(crate) const BANDS: usize = 31;

/// First wavelength in nanometres.
pub(crate) const FIRST_NM: f64 = 400.0;

/// Distance between wavelengths in nanometres.
pub(crate) const STEP_NM: f64 = 10.0;

/// Refractive index of the leaf's material.
pub(crate) const REFRACTIVE_INDEX: [f64; BANDS] = [
    1.4955, 1.5024, 1.5134, 1.5235, 1.5286, 1.5282, 1.5224, 1.5166, 1.5135, 1.5034, 1.4776, 1.4468, 1.4302, 1.4292,
    1.4308, 1.4303, 1.4255, 1.4185, 1.4133, 1.4105, 1.4086, 1.4075, 1.4082, 1.4077, 1.4108, 1.4229, 1.4383, 1.4714,
    1.4963, 1.4445, 1.4106,
];

/// Specific absorption of chlorophyll a + b in cm2/ug.
pub(crate) const CHLOROPHYLL: [f64; BANDS] = [
    0.02676, 0.05526, 0.06475, 0.06979, 0.0712, 0.0609, 0.0499, 0.04622, 0.04413, 0.03683, 0.02502, 0.01536, 0.00949,
    0.008595, 0.01083, 0.01286, 0.01421, 0.0165, 0.0196, 0.02171, 0.02279, 0.02489, 0.02803, 0.02921, 0.03208, 0.0389,
    0.04588, 0.05765, 0.0565, 0.03254, 0.01259,
];

/// Specific absorption of carotenoids in cm2/ug.
pub(crate) const CAROTENOID: [f64; BANDS] = [
    0.2895, 0.2203, 0.1866, 0.1715, 0.1664, 0.1577, 0.1425, 0.1308, 0.127, 0.1166, 0.0966, 0.07275, 0.05018, 0.03026,
    0.01436, 0.003816, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
];

/// Specific absorption of brown pigment, per arbitrary unit.
pub(crate) const BROWN: [f64; BANDS] = [
    0.5272, 0.5172, 0.5072, 0.4972, 0.4852, 0.4733, 0.4608, 0.4504, 0.4401, 0.4272, 0.4144, 0.4057, 0.3962, 0.3867,
    0.3654, 0.3511, 0.3401, 0.3223, 0.3019, 0.2821, 0.2636, 0.2463, 0.2302, 0.2156, 0.202, 0.189, 0.1768, 0.1641,
    0.1504, 0.137, 0.1245,
];

/// Specific absorption of water in 1/cm.
pub(crate) const WATER: [f64; BANDS] = [
    0.000058, 0.000067, 0.000079, 0.000092, 0.000104, 0.000114, 0.000124, 0.000135, 0.000152, 0.000181, 0.000238,
    0.000329, 0.000409, 0.000429, 0.000495, 0.000588, 0.000672, 0.000759, 0.000952, 0.001356, 0.002224, 0.002691,
    0.00281, 0.002955, 0.003111, 0.003315, 0.003791, 0.004122, 0.004318, 0.00476, 0.005722,
];

/// Specific absorption of dry matter in cm2/g.
pub(crate) const DRY_MATTER: [f64; BANDS] = [
    109.7, 63.0, 35.67, 20.24, 10.96, 6.66, 4.575, 3.462, 2.803, 2.573, 2.417, 2.328, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3,
    2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3, 2.3,
];

/// CIE 1931 colour matching function x.
pub(crate) const CIE_X: [f64; BANDS] = [
    0.01431, 0.04351, 0.13438, 0.2839, 0.34828, 0.3362, 0.2908, 0.19536, 0.09564, 0.03201, 0.0049, 0.0093, 0.06327,
    0.1655, 0.2904, 0.4334499, 0.5945, 0.7621, 0.9163, 1.0263, 1.0622, 1.0026, 0.8544499, 0.6424, 0.4479, 0.2835,
    0.1649, 0.0874, 0.04677, 0.0227, 0.01135916,
];

/// CIE 1931 colour matching function y.
pub(crate) const CIE_Y: [f64; BANDS] = [
    0.000396, 0.00121, 0.004, 0.0116, 0.023, 0.038, 0.06, 0.09098, 0.13902, 0.20802, 0.323, 0.503, 0.71, 0.862, 0.954,
    0.9949501, 0.995, 0.952, 0.87, 0.757, 0.631, 0.503, 0.381, 0.265, 0.175, 0.107, 0.061, 0.032, 0.017, 0.00821,
    0.004102,
];

/// CIE 1931 colour matching function z.
pub(crate) const CIE_Z: [f64; BANDS] = [
    0.06785001,
    0.2074,
    0.6456,
    1.3856,
    1.74706,
    1.77211,
    1.6692,
    1.28764,
    0.8129501,
    0.46518,
    0.272,
    0.1582,
    0.07824999,
    0.04216,
    0.0203,
    0.008749999,
    0.0039,
    0.0021,
    0.001650001,
    0.0011,
    0.0008,
    0.00034,
    0.00019,
    0.00005,
    0.00002,
    -0.,
    0.0,
    0.0,
    0.0,
    0.0,
    0.0,
];

/// Relative power of the illuminant D65, 100 at 560 nm.
pub(crate) const D65: [f64; BANDS] = [
    82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354, 107.802, 104.79,
    107.689, 104.405, 104.046, 100.0, 96.3342, 95.788, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268,
    80.2146, 82.2778, 78.2842, 69.7213, 71.6091,
];

/// Chlorophyll at any wavelength in nm: linear between entries, 0 beyond them.
pub(crate) fn prospect_5_chlorophyll(nm: f64) -> f64 {
    between(&CHLOROPHYLL, nm)
}

/// Carotenoids, the same.
pub(crate) fn prospect_5_carotenoid(nm: f64) -> f64 {
    between(&CAROTENOID, nm)
}

fn between(table: &[f64; BANDS], nm: f64) -> f64 {
    let place = (nm - FIRST_NM) / STEP_NM;
    if !(0.0..=(BANDS - 1) as f64).contains(&place) {
        return 0.0;
    }
    let cell = (place as usize).min(BANDS - 2);
    let t = place - cell as f64;
    table[cell] * (1.0 - t) + table[cell + 1] * t
}
