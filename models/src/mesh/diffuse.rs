//! Reflectance and transmittance of diffuse surfaces.

/// Shares of the incident light that a diffuse surface reflects and transmits, linear sRGB, the same for front and
/// back. In each channel they add up to at most 1, so that energy is conserved.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DiffuseColour {
    /// Hemispherical reflectance.
    pub reflectance: [f32; 3],
    /// Hemispherical transmittance; 0 for an opaque surface.
    pub transmittance: [f32; 3],
}

impl DiffuseColour {
    /// Returns the colour of an opaque surface.
    pub const fn opaque(reflectance: [f32; 3]) -> DiffuseColour {
        DiffuseColour { reflectance, transmittance: [0.0; 3] }
    }

    /// Returns the colour of the diffuse part of a glTF material. `base` is reflected, except for the share that
    /// `KHR_materials_diffuse_transmission` transmits in a colour of its own.
    pub(super) fn of_gltf(base: [f32; 3], transmission: f32, transmission_colour: [f32; 3]) -> DiffuseColour {
        let share = transmission.clamp(0.0, 1.0);
        DiffuseColour {
            reflectance: base.map(|x| (1.0 - share) * x.clamp(0.0, 1.0)),
            transmittance: transmission_colour.map(|x| share * x.clamp(0.0, 1.0)),
        }
    }

    /// Returns the colour with both shares multiplied by `tint`. Their sum stays at most 1 if it was before.
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
