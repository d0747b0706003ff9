//! Tables 1 and 2 of Miao et al. and the patches of their Fig. 5, recomputed:
//! `cargo run --release -p btf-synth --example miao_tables [PATCHES.svg]`.
//!
//! The paper gives no contents for its four maize leaves; those here were inferred from Table 1 by least
//! squares (two unknowns for six numbers each). Conditions: one plate, N = 1.5, normal incidence, PROSPECT-5
//! at three wavelengths, no brown pigment and no dry matter.

use btf_synth::plate;

/// PROSPECT-5 at 674, 544 and 435 nm, as Table 1 was computed.
const INDEX: [f64; 3] = [1.4830, 1.4310, 1.5267];
const CHLOROPHYLL: [f64; 3] = [0.05914, 0.01221, 0.0716];
const CAROTENOID: [f64; 3] = [0.0, 0.0073, 0.1682];
const STRUCTURE: f64 = 1.5;

struct Sample {
    /// Inferred contents in ug/cm2.
    chlorophyll: f64,
    carotenoid: f64,
    /// Published: simulated and real reflectance, simulated and real transmittance.
    diffuse: [[f64; 3]; 2],
    transmission: [[f64; 3]; 2],
    /// Published Table 2.
    errors: [[f64; 3]; 2],
}

const SAMPLES: [Sample; 4] = [
    Sample {
        chlorophyll: 31.683,
        carotenoid: 10.573,
        diffuse: [[0.0437, 0.1252, 0.0436], [0.0627, 0.1137, 0.000]],
        transmission: [[0.0632, 0.2875, 0.0095], [0.0106, 0.1961, 0.0156]],
        errors: [[0.019, 0.015, 0.0436], [0.0526, 0.0914, 0.0061]],
    },
    Sample {
        chlorophyll: 59.204,
        carotenoid: 7.284,
        diffuse: [[0.0382, 0.0788, 0.0435], [0.0745, 0.1255, 0.0078]],
        transmission: [[0.0159, 0.1990, 0.0031], [0.0627, 0.1373, 0.0039]],
        errors: [[0.0363, 0.0467, 0.0357], [0.0468, 0.0617, 0.0008]],
    },
    Sample {
        chlorophyll: 0.0,
        carotenoid: 9.081,
        diffuse: [[0.3933, 0.3041, 0.0540], [0.4117, 0.3490, 0.0510]],
        transmission: [[0.6067, 0.5378, 0.0808], [0.5255, 0.4863, 0.0352]],
        errors: [[0.0184, 0.0450, 0.0030], [0.0812, 0.0515, 0.0456]],
    },
    Sample {
        chlorophyll: 11.622,
        carotenoid: 3.167,
        diffuse: [[0.0940, 0.2329, 0.0578], [0.1059, 0.1961, 0.0311]],
        transmission: [[0.2034, 0.4464, 0.0942], [0.1686, 0.2980, 0.0274]],
        errors: [[0.0119, 0.0368, 0.0267], [0.0348, 0.1484, 0.0668]],
    },
];

fn simulated(sample: &Sample) -> [[f64; 3]; 2] {
    let optics: [_; 3] = std::array::from_fn(|band| {
        let k = (CHLOROPHYLL[band] * sample.chlorophyll + CAROTENOID[band] * sample.carotenoid) / STRUCTURE;
        plate(k, INDEX[band], 0.0)
    });
    [optics.map(|o| o.reflectance), optics.map(|o| o.transmittance)]
}

fn main() {
    println!("Table 1: simulated, published, largest difference; Table 2: recomputed, published\n");
    let mut worst = 0f64;
    let mut misprints = 0;
    for (i, sample) in SAMPLES.iter().enumerate() {
        let here = simulated(sample);
        for (quantity, rgb, [published, real], errors) in [
            ("diffuse", here[0], sample.diffuse, sample.errors[0]),
            ("transmission", here[1], sample.transmission, sample.errors[1]),
        ] {
            let difference = (0..3).map(|c| (rgb[c] - published[c]).abs()).fold(0.0, f64::max);
            worst = worst.max(difference);
            let again: [f64; 3] = std::array::from_fn(|c| (published[c] - real[c]).abs());
            let wrong = (0..3).filter(|&c| (again[c] - errors[c]).abs() > 5.1e-5).count();
            misprints += wrong;
            println!(
                "{} {quantity:<12} {rgb:.4?} {published:.4?} {difference:.1e}   {again:.4?} {errors:.4?}{}",
                i + 1,
                if wrong > 0 { "  <- misprint" } else { "" }
            );
        }
    }
    println!(
        "\nlargest difference to Table 1: {worst:.1e}; entries of Table 2 that do not follow from it: {misprints}"
    );
    if let Some(path) = std::env::args().nth(1) {
        std::fs::write(&path, patches()).unwrap_or_else(|error| eprintln!("error: {path} cannot be written ({error})"));
    }
}

/// Fig. 5: each sample's simulated and real reflectance and transmittance as colours.
fn patches() -> String {
    let srgb = |x: f64| {
        let x = x.clamp(0.0, 1.0);
        let encoded = if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
    };
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 520 500\" width=\"520\" height=\"500\" font-family=\"sans-serif\" \
         font-size=\"13\"><rect width=\"520\" height=\"500\" fill=\"#fff\"/>",
    );
    for (i, heading) in ["diffuse, here", "diffuse, real", "transmitted, here", "transmitted, real"].iter().enumerate()
    {
        svg += &format!("<text x=\"{}\" y=\"24\" text-anchor=\"middle\">{heading}</text>", 90 + 116 * i);
    }
    for (row, sample) in SAMPLES.iter().enumerate() {
        let here = simulated(sample);
        let y = 40 + 114 * row;
        svg += &format!("<text x=\"14\" y=\"{}\">{}</text>", y + 56, row + 1);
        for (column, rgb) in [here[0], sample.diffuse[1], here[1], sample.transmission[1]].iter().enumerate() {
            let [r, g, b] = rgb.map(srgb);
            let x = 36 + 116 * column;
            svg += &format!("<rect x=\"{x}\" y=\"{y}\" width=\"108\" height=\"106\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>");
        }
    }
    svg + "</svg>\n"
}
