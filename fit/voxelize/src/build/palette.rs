//! Palette of the voxels' materials, in which similar materials become one.

use crate::model::microflakes::MicroflakeSums;
use btf_runtime::voltex::MicroflakeMaterial;
use std::collections::BTreeMap;

/// Steps between 0 and 1 of the roots of shares and of roughness, within which voxels share a material.
const STEPS: f32 = 40.0;

/// Palette that numbers materials in the order in which they are met.
#[derive(Debug, Default)]
pub struct Palette {
    numbers: BTreeMap<[u8; 8], usize>,
    /// Sums of area, and of what that reflects and transmits, of each material.
    sums: Vec<MicroflakeSums>,
}

impl Palette {
    /// Returns the number of the material of `microflakes`. Microflakes whose colours lie in one cell of a grid share
    /// it.
    pub fn number(&mut self, microflakes: &MicroflakeSums) -> u32 {
        let colour = mean_of(microflakes);
        let code = |x: f32| (x.clamp(0.0, 1.0).sqrt() * STEPS).round() as u8;
        let ([a, b, c], [d, e, f]) = (colour.reflectance, colour.transmittance);
        let next = self.sums.len();
        let specular = code(colour.specular);
        // Next to no gloss has no roughness.
        let roughness = if specular > 0 { code(colour.roughness) } else { 0 };
        let [a, b, c, d, e, f] = [a, b, c, d, e, f].map(code);
        let number = *self.numbers.entry([a, b, c, d, e, f, specular, roughness]).or_insert(next);
        if number == next {
            self.sums.push(MicroflakeSums::default());
        }
        self.sums[number].add(microflakes);
        number as u32
    }

    /// Returns the materials: means over the microflakes that share them.
    pub fn materials(&self) -> Vec<MicroflakeMaterial> {
        self.sums.iter().map(mean_of).collect()
    }
}

fn mean_of(microflakes: &MicroflakeSums) -> MicroflakeMaterial {
    let mean = |sums: [f32; 3]| sums.map(|x| x / microflakes.area.max(1e-30));
    let [specular, rough] = microflakes.gloss.map(|x| x / microflakes.area.max(1e-30));
    MicroflakeMaterial {
        reflectance: mean(microflakes.reflected),
        transmittance: mean(microflakes.transmitted),
        specular,
        roughness: rough / specular.max(1e-30),
    }
}
