//! What a diffuse surface does with light.

/// Shares of the light that falls on a diffuse surface which leave it on the side where it came from and on the other, linear
/// sRGB; of either side alike. Together at most 1, or the surface would shine.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DiffuseColour {
    /// Hemispherical reflectance.
    pub reflectance: [f32; 3],
    /// Hemispherical transmittance; 0 for an opaque surface.
    pub transmittance: [f32; 3],
}

impl DiffuseColour {
    /// Of an opaque surface.
    pub const fn opaque(reflectance: [f32; 3]) -> DiffuseColour {
        DiffuseColour { reflectance, transmittance: [0.0; 3] }
    }

    /// Of the diffuse part of a glTF material: `base` is reflected, but for the share that `KHR_materials_diffuse_transmission`
    /// lets through in a colour of its own.
    pub(super) fn of_gltf(base: [f32; 3], transmission: f32, transmission_colour: [f32; 3]) -> DiffuseColour {
        let share = transmission.clamp(0.0, 1.0);
        DiffuseColour {
            reflectance: base.map(|x| (1.0 - share) * x.clamp(0.0, 1.0)),
            transmittance: transmission_colour.map(|x| share * x.clamp(0.0, 1.0)),
        }
    }

    /// With both shares times `tint`, and together no more than all light, if they were not before.
    #[must_use]
    pub fn tinted(self, tint: [f32; 3]) -> DiffuseColour {
        let factor: [f32; 3] = std::array::from_fn(|channel| {
            let sum = self.reflectance[channel] + self.transmittance[channel];
            tint[channel].min((1.0 / sum.max(1e-6)).max(1.0))
        });
        let times = |shares: [f32; 3]| std::array::from_fn(|channel| shares[channel] * factor[channel]);
        DiffuseColour { reflectance: times(self.reflectance), transmittance: times(self.transmittance) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tint_takes_no_more_than_all_light() {
        let leaf = DiffuseColour { reflectance: [0.3, 0.5, 0.2], transmittance: [0.2, 0.3, 0.0] };
        let tinted = leaf.tinted([0.5, 2.0, 2.0]);
        assert_eq!((tinted.reflectance[0], tinted.transmittance[0]), (0.15, 0.1));
        // The two stay in proportion.
        assert_eq!((tinted.reflectance[1], tinted.transmittance[1]), (0.5 / 0.8, 0.3 / 0.8));
        assert_eq!((tinted.reflectance[2], tinted.transmittance[2]), (0.4, 0.0));
    }
}
