//! Tables of leaf optics: refractive index and specific absorption of leaf tissue by wavelength.
//!
//! PROSPECT-D's refractive index and specific absorptions [Feret 2017], every 10 nm; PROSPECT-5's [Feret 2008] at the
//! paper's three wavelengths; the paper's printed numbers [Miao, after eq. 5]; and the bands that stand for a spectrum.

/// The optical constants of leaf tissue at one wavelength.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafRow {
    /// Wavelength in nanometres.
    pub wavelength_nm: f32,
    /// Refractive index of the leaf's material.
    pub index: f32,
    /// Specific absorptions: chlorophyll a + b, carotenoids and anthocyanins in cm2/ug, brown pigment per arbitrary
    /// unit, water in 1/cm, dry matter in cm2/g.
    pub absorption: [f32; 6],
}

impl LeafRow {
    const fn new(wavelength_nm: f32, [index, a, b, c, d, e, f]: [f32; 7]) -> LeafRow {
        LeafRow { wavelength_nm, index, absorption: [a, b, c, d, e, f] }
    }
}

/// PROSPECT-D [Feret 2017], 400 to 780 nm every 10 nm.
#[rustfmt::skip]
pub static LEAF_ROWS: [LeafRow; 39] = [
    LeafRow::new(400.0, [1.5115, 0.0648815, 0.16734, 0.0666747, 0.5272, 5.8e-05, 109.7]),
    LeafRow::new(410.0, [1.5081, 0.0714914, 0.165882, 0.0509515, 0.5172, 6.7e-05, 63.0]),
    LeafRow::new(420.0, [1.5032, 0.0698193, 0.167164, 0.0454286, 0.5072, 7.9e-05, 35.67]),
    LeafRow::new(430.0, [1.5002, 0.0724491, 0.167551, 0.0438612, 0.4972, 9.2e-05, 20.24]),
    LeafRow::new(440.0, [1.498, 0.0737942, 0.169569, 0.0447865, 0.4852, 0.000104, 10.96]),
    LeafRow::new(450.0, [1.4955, 0.0587747, 0.167441, 0.0464136, 0.4733, 0.000114, 6.66]),
    LeafRow::new(460.0, [1.4937, 0.0438733, 0.151672, 0.0488393, 0.4608, 0.000124, 4.575]),
    LeafRow::new(470.0, [1.4923, 0.0397273, 0.137008, 0.0519406, 0.4504, 0.000135, 3.462]),
    LeafRow::new(480.0, [1.491, 0.0367757, 0.133271, 0.0571515, 0.4401, 0.000152, 2.803]),
    LeafRow::new(490.0, [1.4896, 0.0296622, 0.120655, 0.0629224, 0.4272, 0.000181, 2.573]),
    LeafRow::new(500.0, [1.488, 0.0190485, 0.0990044, 0.0677709, 0.4144, 0.000238, 2.417]),
    LeafRow::new(510.0, [1.4861, 0.00970081, 0.0759473, 0.0704719, 0.4057, 0.000329, 2.328]),
    LeafRow::new(520.0, [1.4836, 0.00433379, 0.0532106, 0.0716821, 0.3962, 0.000409, 2.3]),
    LeafRow::new(530.0, [1.4807, 0.00406899, 0.0325209, 0.0723492, 0.3867, 0.000429, 2.3]),
    LeafRow::new(540.0, [1.4774, 0.0067864, 0.0156048, 0.0720633, 0.3654, 0.000495, 2.3]),
    LeafRow::new(550.0, [1.4739, 0.00930939, 0.00418898, 0.0681398, 0.3511, 0.000588, 2.3]),
    LeafRow::new(560.0, [1.4701, 0.011048, 0.0, 0.0596515, 0.3401, 0.000672, 2.3]),
    LeafRow::new(570.0, [1.4662, 0.0135979, 0.0, 0.0484808, 0.3223, 0.000759, 2.3]),
    LeafRow::new(580.0, [1.4624, 0.0169452, 0.0, 0.037412, 0.3019, 0.000952, 2.3]),
    LeafRow::new(590.0, [1.4588, 0.0194191, 0.0, 0.0268029, 0.2821, 0.001356, 2.3]),
    LeafRow::new(600.0, [1.4559, 0.020854, 0.0, 0.0187401, 0.2636, 0.002224, 2.3]),
    LeafRow::new(610.0, [1.4533, 0.0231769, 0.0, 0.0128011, 0.2463, 0.002691, 2.3]),
    LeafRow::new(620.0, [1.451, 0.0265303, 0.0, 0.00841103, 0.2302, 0.00281, 2.3]),
    LeafRow::new(630.0, [1.4492, 0.0279776, 0.0, 0.00539765, 0.2156, 0.002955, 2.3]),
    LeafRow::new(640.0, [1.448, 0.0312475, 0.0, 0.00345303, 0.202, 0.003111, 2.3]),
    LeafRow::new(650.0, [1.4473, 0.0390136, 0.0, 0.00225247, 0.189, 0.003315, 2.3]),
    LeafRow::new(660.0, [1.4468, 0.0474949, 0.0, 0.00147128, 0.1768, 0.003791, 2.3]),
    LeafRow::new(670.0, [1.4464, 0.0661121, 0.0, 0.000784759, 0.1641, 0.004122, 2.3]),
    LeafRow::new(680.0, [1.4458, 0.0689206, 0.0, 0.000201097, 0.1504, 0.004318, 2.3]),
    LeafRow::new(690.0, [1.4451, 0.033671, 0.0, 0.0, 0.137, 0.00476, 2.3]),
    LeafRow::new(700.0, [1.4444, 0.0122406, 0.0, 0.0, 0.1245, 0.005722, 2.3]),
    LeafRow::new(710.0, [1.4433, 0.00542144, 0.0, 0.0, 0.1133, 0.007415, 2.3]),
    LeafRow::new(720.0, [1.4417, 0.0026434, 0.0, 0.0, 0.1024, 0.01072, 2.3]),
    LeafRow::new(730.0, [1.4398, 0.0012386, 0.0, 0.0, 0.09218, 0.01621, 2.3]),
    LeafRow::new(740.0, [1.438, 0.000567642, 0.0, 0.0, 0.08239, 0.02532, 2.3]),
    LeafRow::new(750.0, [1.4366, 0.000298414, 0.0, 0.0, 0.07393, 0.02733, 2.3]),
    LeafRow::new(760.0, [1.4352, 0.000153058, 0.0, 0.0, 0.06653, 0.02771, 2.3]),
    LeafRow::new(770.0, [1.4343, 4.3372e-05, 0.0, 0.0, 0.05983, 0.02754, 2.3]),
    LeafRow::new(780.0, [1.434, 0.0, 0.0, 0.0, 0.05284, 0.02659, 2.3]),
];

/// PROSPECT-5 [Feret 2008] at Miao's wavelengths of red, green and blue. The anthocyanins, which PROSPECT-5 does not
/// have, are PROSPECT-D's.
#[rustfmt::skip]
pub static THREE_ROWS: [LeafRow; 3] = [
    LeafRow::new(675.0, [1.4857, 0.05914, 0.0, 0.000446948, 0.1572, 0.004196, 2.3]),
    LeafRow::new(546.0, [1.4309, 0.01221, 0.007301, 0.0703069, 0.3568, 0.000544, 2.3]),
    LeafRow::new(435.0, [1.5267, 0.0716, 0.1682, 0.0442029, 0.4912, 9.801e-05, 14.81]),
];

/// Numbers of [Miao, after eq. 5] as printed, including the misprint in dry matter at 435 nm (1.481 for 14.81 cm2/g)
/// and the rounding of the carotenoids (0.168). Anthocyanins and water are missing in the paper.
#[rustfmt::skip]
pub static PRINTED_ROWS: [LeafRow; 3] = [
    LeafRow::new(675.0, [1.42, 0.05914, 0.0, 0.0, 0.1572, 0.0, 2.3]),
    LeafRow::new(546.0, [1.42, 0.01221, 0.0073, 0.0, 0.3568, 0.0, 2.3]),
    LeafRow::new(435.0, [1.42, 0.0716, 0.168, 0.0, 0.4912, 0.0, 1.481]),
];

/// Number of bands that the N-layer mode sums over.
pub const LEAF_BANDS: usize = 12;

/// Wavelength of each band in nanometres.
pub const LEAF_BAND_NM: [f32; LEAF_BANDS] =
    [420.0, 440.0, 460.0, 480.0, 510.0, 530.0, 550.0, 570.0, 590.0, 610.0, 640.0, 660.0];

/// Wavelength of each band in nanometres, a row of [`LEAF_ROWS`], and the band's share of linear red, green and blue.
///
/// The shares are fitted so that their sum is the colour that 31 wavelengths under D65 give for leaves of any contents
/// (CIEDE2000 of 3000 held-out colours: 0.02 in the mean, 0.19 at most); each column adds up to 1. Reproduce with
/// `cargo run --release -p btf-tests -- leaf_fits`.
#[rustfmt::skip]
pub static BAND_SHARES: [(f32, [f32; 3]); LEAF_BANDS] = [
    (420.0, [0.039788, -0.023886, 0.145188]),
    (440.0, [0.03938, -0.031698, 0.351888]),
    (460.0, [-0.066195, -0.032393, 0.345132]),
    (480.0, [-0.042628, 0.075645, 0.257281]),
    (510.0, [-0.195817, 0.221011, 0.013551]),
    (530.0, [-0.158795, 0.281882, -0.024025]),
    (550.0, [-0.021452, 0.280377, -0.030775]),
    (570.0, [0.193728, 0.203901, -0.034734]),
    (590.0, [0.300819, 0.064377, -0.003659]),
    (610.0, [0.586874, -0.00809, -0.02079]),
    (640.0, [0.211457, -0.021926, 0.004282]),
    (660.0, [0.112841, -0.0092, -0.003339]),
];
