//! Sums over the microflakes of a voxel while a volume is built.

use glam::Vec3;

/// Unit directions along which the projected area is summed: to the faces, edges and corners of a cube, one of each two
/// that are opposite.
pub const DIRECTIONS: [Vec3; 13] = {
    const E: f32 = std::f32::consts::FRAC_1_SQRT_2;
    const C: f32 = 0.577_350_26;
    [
        Vec3::X,
        Vec3::Y,
        Vec3::Z,
        Vec3::new(E, E, 0.0),
        Vec3::new(E, -E, 0.0),
        Vec3::new(E, 0.0, E),
        Vec3::new(E, 0.0, -E),
        Vec3::new(0.0, E, E),
        Vec3::new(0.0, E, -E),
        Vec3::new(C, C, C),
        Vec3::new(C, C, -C),
        Vec3::new(C, -C, C),
        Vec3::new(C, -C, -C),
    ]
};

/// Returns the luminance of linear sRGB as a share of white's [IEC 61966-2-1].
pub fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

/// Sums over microflakes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MicroflakeSums {
    /// Sum of area.
    pub area: f32,
    /// Sum of area projected along each of [`DIRECTIONS`].
    pub projected: [f32; 13],
    /// Sum of `area n n'`: xx, yy, zz, xy, xz, yz.
    pub moment: [f32; 6],
    /// Sum of area times reflectance.
    pub reflected: [f32; 3],
    /// Sum of area times transmittance.
    pub transmitted: [f32; 3],
    /// Sum of area times specular reflectance, and of that times roughness.
    pub gloss: [f32; 2],
}

/// Material of a microflake, linear sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MicroflakeColour {
    /// Hemispherical reflectance without the specular lobe, mean of both sides.
    pub reflectance: [f32; 3],
    /// Hemispherical transmittance.
    pub transmittance: [f32; 3],
    /// Reflectance of the smooth surface at normal incidence; 0 for none.
    pub specular: f32,
    /// Roughness of the specular lobe, GGX alpha.
    pub roughness: f32,
}

impl MicroflakeSums {
    /// Returns the sums of one microflake with a unit normal.
    pub fn microflake(area: f32, n: Vec3, colour: &MicroflakeColour) -> MicroflakeSums {
        let moment = [n.x * n.x, n.y * n.y, n.z * n.z, n.x * n.y, n.x * n.z, n.y * n.z].map(|x| x * area);
        MicroflakeSums::new(area, DIRECTIONS.map(|d| area * n.dot(d).abs()), moment, colour)
    }

    /// Returns the sums of microflakes of one colour, whose area, projected areas and moment are known.
    pub fn new(area: f32, projected: [f32; 13], moment: [f32; 6], colour: &MicroflakeColour) -> MicroflakeSums {
        MicroflakeSums {
            area,
            projected,
            moment,
            reflected: colour.reflectance.map(|x| x * area),
            transmitted: colour.transmittance.map(|x| x * area),
            gloss: [1.0, colour.roughness].map(|x| x * colour.specular * area),
        }
    }

    /// Returns the sums of `factor` times as many microflakes.
    pub fn scaled(&self, factor: f32) -> MicroflakeSums {
        let times = |x: f32| x * factor;
        MicroflakeSums {
            area: times(self.area),
            projected: self.projected.map(times),
            moment: self.moment.map(times),
            reflected: self.reflected.map(times),
            transmitted: self.transmitted.map(times),
            gloss: self.gloss.map(times),
        }
    }

    /// Adds the sums of other microflakes.
    pub fn add(&mut self, other: &MicroflakeSums) {
        self.area += other.area;
        let pairs = [
            (&mut self.projected[..], &other.projected[..]),
            (&mut self.moment, &other.moment),
            (&mut self.reflected, &other.reflected),
            (&mut self.transmitted, &other.transmitted),
            (&mut self.gloss, &other.gloss),
        ];
        for (sums, values) in pairs {
            sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
    }
}

/// Share of a cell's microflakes below which a sort is none of its own.
const MIN_SORT: f32 = 0.02;

/// Sums over the microflakes of a cell, apart for two sorts that lie differently: leaves and what bears them.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct CellMicroflakes {
    /// Sums of microflakes that let light through.
    pub translucent: MicroflakeSums,
    /// Sums of the other microflakes.
    pub opaque: MicroflakeSums,
}

impl CellMicroflakes {
    /// Adds microflakes of one sort.
    pub fn add(&mut self, microflakes: &MicroflakeSums) {
        let lets_through = microflakes.transmitted.iter().any(|x| *x > 0.0);
        if lets_through { &mut self.translucent } else { &mut self.opaque }.add(microflakes);
    }

    /// Adds the microflakes of another cell.
    pub fn add_cell(&mut self, other: &CellMicroflakes) {
        self.translucent.add(&other.translucent);
        self.opaque.add(&other.opaque);
    }

    /// Returns the sums of `factor` times as many microflakes of each sort.
    pub fn scaled(&self, factor: f32) -> CellMicroflakes {
        CellMicroflakes { translucent: self.translucent.scaled(factor), opaque: self.opaque.scaled(factor) }
    }

    /// Returns the sums of both sorts together.
    pub fn all(&self) -> MicroflakeSums {
        let mut all = self.translucent;
        all.add(&self.opaque);
        all
    }

    /// Returns the sorts that matter: both together where one of them is next to nothing.
    pub fn sorts(&self) -> (MicroflakeSums, Option<MicroflakeSums>) {
        let (all, least) = (self.all(), self.translucent.area.min(self.opaque.area));
        if least < MIN_SORT * all.area { (all, None) } else { (self.translucent, Some(self.opaque)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn microflakes_are_sorted_by_what_passes_them_and_a_few_of_a_sort_are_none() {
        let leaf = MicroflakeColour { transmittance: [0.0, 0.1, 0.0], ..MicroflakeColour::default() };
        let mut cell = CellMicroflakes::default();
        cell.add(&MicroflakeSums::microflake(2.0, Vec3::Z, &leaf));
        assert_eq!(cell.sorts(), (cell.all(), None));
        cell.add(&MicroflakeSums::microflake(0.03, Vec3::X, &MicroflakeColour::default()));
        assert_eq!(cell.sorts(), (cell.all(), None));
        let before = cell.all();
        cell.add(&MicroflakeSums::microflake(0.03, Vec3::X, &MicroflakeColour::default()));
        let (translucent, opaque) = cell.sorts();
        assert_eq!((translucent.area, opaque.map(|opaque| opaque.area)), (2.0, Some(0.06)));
        assert!(cell.all().area > before.area && cell.scaled(2.0).opaque.area == 0.12);
    }
}
