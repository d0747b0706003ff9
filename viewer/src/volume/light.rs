//! Light of volumetric textures along a ray: one filtered ray, each path at one of the two levels nearest to what a pixel sees. Twin:
//! `light.wgsl`.

use crate::geometry::lod_transition::LodTransition;
use crate::volume::volumes::{SkinTet, Stretch, Volumes};
use btf_runtime::voltex::{Cell, NO_VOXEL, Voltex, VoltexRay, Walk, gloss, seen_at, shade};
use glam::{Mat3, Vec3};

/// Transmittance below which a ray ends.
const END: f32 = 1.0 / 255.0;
/// Optical depth beyond which a ray ends that counts all of it.
const MAX_DEPTH: f32 = 7.824_046;
/// Share of light that counts as none: a ray to a light ends there at the latest.
const MIN_PASSED: f32 = 4e-4;
/// Share of light below which a ray to a light goes on by chance, as likely as what is left of the share, and then counts that share:
/// the mean is the same. Rays end where next to nothing passes, for no noise that is seen.
const ROULETTE: f32 = 0.3;
/// Least share of a pixel that a segment must hide to count: less may be there or not by rounding.
const MIN_OPACITY: f32 = 1e-5;
/// Share of a pixel that must be hidden before light is asked for anew. 1/16 takes twice as long, for 2 % less noise of a lawn's picture.
const SHADOW_STEP: f32 = 1.0 / 2.0;
/// Least roughness of microflakes in light from all around, of which one direction is drawn at one place of all that a
/// ray sees: without it a microflake that is seen from its edge, and rarely drawn, would be as bright as all of them.
pub(crate) const AROUND_ROUGHNESS: f32 = 0.7;
/// The constants that the shader has too, by name.
#[cfg(test)]
pub(crate) const CONSTANTS: &[(&str, f32)] = &[
    ("VOLUME_END", END),
    ("VOLUME_MIN_PASSED", MIN_PASSED),
    ("VOLUME_ROULETTE", ROULETTE),
    ("VOLUME_MIN_OPACITY", MIN_OPACITY),
    ("VOLUME_SHADOW_STEP", SHADOW_STEP),
    ("VOLUME_AROUND_ROUGHNESS", AROUND_ROUGHNESS),
];

/// A ray to a light.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LightRay {
    /// Where it begins.
    pub origin: Vec3,
    /// Unit direction to the light.
    pub direction: Vec3,
    /// Distance of the light.
    pub t_max: f32,
    /// Width of voxels that it sees.
    pub width: f32,
}

/// The content of a volume that a ray meets at one place.
#[derive(Debug, Clone, Copy)]
pub struct VolumePoint {
    /// Along the ray.
    pub t: f32,
    /// Share of the pixel that the place hides.
    pub weight: f32,
    /// The tetrahedron that the volume is mapped by; `None` where it stands on its own.
    pub within: Option<SkinTet>,
    volume: usize,
    map: Mat3,
    level: u32,
    cell: SeenCell,
    view: Vec3,
}

/// A segment's cell: its voxel's number, and its extinction along the ray.
#[derive(Debug, Clone, Copy)]
struct SeenCell {
    number: u32,
    sigma: f32,
}

/// Returns the level of which a path sees voxels where they are to be about `width` wide in the world: of the two between
/// which that lies one, as likely as it is near. A mean of both levels' extinctions would hide more than either does, since
/// their gaps lie elsewhere.
fn level_of(voltex: &Voltex, map: &Mat3, width: f32, share: f32) -> u32 {
    let scale = map.determinant().abs().cbrt();
    let most = voltex.level_count();
    let voxels = width * scale * (1u32 << most) as f32;
    let level = voxels.clamp(1e-9, 1e9).log2().clamp(0.0, most as f32);
    ((level + share) as u32).min(most)
}

/// Returns the level at which a cell is met: `level`, or a coarser one where the volume's brick is not loaded so fine.
fn level_met(level: u32, cell: &Cell) -> u32 {
    if cell.voxel == NO_VOXEL { level } else { cell.size }
}

/// Returns the factor on optical depths along d for the clumping of the level `met`; `clumping` is that of `level`.
fn clumping_met(voltex: &Voltex, level: u32, clumping: f32, met: u32, d: [f32; 3]) -> f32 {
    if met == level { clumping } else { voltex.clumping_along(met, d) }
}

impl VolumePoint {
    /// Returns the light that the point reflects and transmits of what comes from `light` (a unit vector towards it)
    /// with irradiance pi, without shadow. The specular lobe counts as if the roughness were at least
    /// `least_roughness`.
    pub fn reflected(&self, volumes: &Volumes, light: Vec3, least_roughness: f32) -> Vec3 {
        let voltex = volumes.volume(self.volume);
        let l = self.map * light * self.map.determinant().abs().cbrt().recip();
        // A map without volume leaves nothing of a direction.
        let [eye, lamp] = [-self.view, l].map(Vec3::normalize_or_zero);
        let mut sum = Vec3::ZERO;
        for (_, voxel) in voltex.microflakes(self.cell.number) {
            let material = voltex.material(voxel.material);
            let [same, other] = shade(&voxel.moment, (-self.view).into(), l.into());
            sum += Vec3::from(material.reflectance) * same + Vec3::from(material.transmittance) * other;
            if material.specular > 0.0 {
                // In proportion to the eye's vector, as the sums above.
                let roughness = material.roughness.max(least_roughness);
                let shine = gloss(&voxel.extinction, material.specular, roughness, eye.into(), lamp.into());
                let denser = voltex.facets_along(self.level, (eye + lamp).into());
                sum += self.view.length() * denser * shine;
            }
        }
        // The clumping, by which all of them count for less or more, is in both.
        let clumping = voltex.clumping_along(self.level, self.view.into());
        sum * (clumping * voltex.brighter_between(self.level, eye.into(), lamp.into()) / self.cell.sigma)
    }

    /// Returns where a ray to a light begins, relative to the point, in the world.
    pub fn shadow_offset(&self, volumes: &Volumes, light: Vec3) -> Vec3 {
        let voltex = volumes.volume(self.volume);
        let l = self.map * light;
        let offset = voltex.shadow(self.level).offset * voltex.voxel_side(self.level);
        let microflakes = voltex.microflakes(self.cell.number);
        let towards: Vec3 = microflakes.map(|(_, voxel)| Vec3::from(voxel.moment.times(l.into()))).sum();
        let inverse = self.map.inverse();
        inverse * (towards.normalize_or_zero() * offset)
    }

    /// Returns the share c by which eye and light see the same gaps, where the angle between them has this cosine.
    pub fn shared(&self, volumes: &Volumes, cos: f32) -> f32 {
        volumes.volume(self.volume).shadow(self.level).shared_at(cos)
    }
}

/// Returns the ray of a stretch, t counted from its own start.
fn walk_of(voltex: &Voltex, stretch: &Stretch) -> Walk {
    let VoltexRay { origin, direction } = stretch.ray;
    Walk::new(
        VoltexRay { origin, direction },
        stretch.t0 - stretch.start,
        stretch.t1 - stretch.start,
        voltex.level_count(),
    )
}

impl Volumes {
    /// Marches along a ray from the eye and calls `each` for the places that hide a share of the pixel together;
    /// returns the transmittance. `width_at` is how wide voxels should be at a distance.
    pub fn march(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        lod_transition: &LodTransition,
        width_at: impl Fn(f32) -> f32,
        mut each: impl FnMut(VolumePoint),
    ) -> f32 {
        let mut through = 1.0;
        for stretch in self.stretches(origin, direction, t_max, lod_transition).beyond_mesh() {
            let voltex = self.volume(stretch.volume);
            let map = stretch.volume_from_world;
            let level = level_of(voltex, &map, width_at(0.5 * (stretch.t0 + stretch.t1)), lod_transition.level_share);
            let d = stretch.ray.direction;
            let clumping = voltex.clumping_along(level, d);
            let mut walk = walk_of(voltex, &stretch);
            while let Some(segment) = walk.next(voltex, level) {
                let number = segment.cell.voxel;
                let met = level_met(level, &segment.cell);
                let sigma = clumping_met(voltex, level, clumping, met, d) * voltex.extinction_along(number, d);
                let length = segment.t1 - segment.t0;
                let depth = sigma * length;
                let hidden = 1.0 - (-depth).exp();
                if hidden <= MIN_OPACITY {
                    continue;
                }
                each(VolumePoint {
                    t: stretch.start + segment.t0 + seen_at(depth, length),
                    weight: through * hidden,
                    within: stretch.within,
                    volume: stretch.volume,
                    map,
                    level: met,
                    cell: SeenCell { number, sigma },
                    view: d.into(),
                });
                through *= 1.0 - hidden;
                if through < END {
                    return 0.0;
                }
            }
        }
        through
    }

    /// Returns the share of a light that passes along a ray to it, in the mean over `chance` from 0 to below 1, where optical depths
    /// count `factor`.
    pub(crate) fn light_share(&self, ray: &LightRay, lod_transition: &LodTransition, factor: f32, chance: f32) -> f32 {
        passed(self.depth_within(ray, &lod_transition.to_light(), most_depth(factor, chance)), factor)
    }

    /// Returns the optical depth along a ray, through voxels `width` wide.
    pub fn depth(&self, origin: Vec3, direction: Vec3, t_max: f32, lod_transition: &LodTransition, width: f32) -> f32 {
        self.depth_within(&LightRay { origin, direction, t_max, width }, lod_transition, MAX_DEPTH)
    }

    /// Returns the optical depth along a ray; infinity where that is more than `most`.
    fn depth_within(&self, ray: &LightRay, lod_transition: &LodTransition, most: f32) -> f32 {
        let LightRay { origin, direction, t_max, width } = *ray;
        let mut sum = 0.0;
        for stretch in self.stretches_in_turn(origin, direction, t_max, lod_transition).beyond_mesh() {
            let voltex = self.volume(stretch.volume);
            let level = level_of(voltex, &stretch.volume_from_world, width, lod_transition.level_share);
            let d = stretch.ray.direction;
            let clumping = voltex.clumping_along(level, d);
            let mut walk = walk_of(voltex, &stretch);
            while let Some(segment) = walk.next(voltex, level) {
                let along = clumping_met(voltex, level, clumping, level_met(level, &segment.cell), d);
                sum += along * voltex.extinction_along(segment.cell.voxel, d) * (segment.t1 - segment.t0);
                if sum > most {
                    return f32::INFINITY;
                }
            }
        }
        sum
    }
}

/// Returns the optical depth beyond which a ray to a light ends, where depths count `factor`.
fn most_depth(factor: f32, chance: f32) -> f32 {
    -(ROULETTE * chance).max(MIN_PASSED).ln() / factor.max(1e-6)
}

/// Returns the share of a light that passes so great a depth, where depths count `factor`; in the mean over the chance that said how
/// far the ray goes.
fn passed(depth: f32, factor: f32) -> f32 {
    if depth < f32::INFINITY { (-factor * depth).exp().max(ROULETTE) } else { 0.0 }
}

/// Returns whether light must be asked for anew, after so much was hidden since it last was.
pub(crate) fn asks_anew(hidden: f32) -> bool {
    hidden > SHADOW_STEP
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::volume::skin::{Pattern, ShellLevel, ShellParams, Skin, SkinVertex};
    use crate::volume::volumes::{SceneSkin, VolumePlace};
    use btf_runtime::testing::{Random, random_volume};
    use glam::{Mat4, Quat};
    use std::sync::Arc;

    fn voltex(seed: u64) -> Arc<Voltex> {
        Arc::new(Voltex::new(&random_volume(&mut Random::new(seed), 3, 0.4)))
    }

    fn direction(random: &mut Random) -> Vec3 {
        Vec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(-1.0, 1.0)).normalize()
    }

    fn alone(voltex: &Arc<Voltex>, map: Mat4) -> Volumes {
        Volumes::new(
            vec![voltex.clone()],
            &[VolumePlace { volume: 0, world_from_volume: map, leaf_width: 0.0 }],
            Vec::new(),
        )
        .unwrap()
    }

    /// Depth of what stands for no mesh, along a whole ray.
    fn depth(volumes: &Volumes, origin: Vec3, direction: Vec3) -> f32 {
        volumes.depth(origin, direction, 1e30, &LodTransition::MESHES, 0.0)
    }

    /// Depths are told apart as what passes.
    fn far(a: f32, b: f32) -> f32 {
        ((-a).exp() - (-b).exp()).abs()
    }

    #[test]
    fn a_volume_is_as_dense_wherever_it_stands_and_however_it_is_turned() {
        let own = voltex(3);
        let here = alone(&own, Mat4::IDENTITY);
        let mut random = Random::new(8);
        for _ in 0..12 {
            let turn = Quat::from_axis_angle(direction(&mut random), random.within(0.0, 6.0));
            let scale = Vec3::new(-0.7, 1.9, 1.1) * random.within(0.1, 9.0);
            let map = Mat4::from_scale_rotation_translation(scale, turn, direction(&mut random) * 20.0);
            let there = alone(&own, map);
            for _ in 0..40 {
                let (from, to) =
                    (Vec3::splat(0.5) + direction(&mut random), Vec3::splat(0.5) + direction(&mut random) * 0.4);
                let own_depth = depth(&here, from, (to - from).normalize());
                let moved = map.transform_point3(from);
                let towards = (map.transform_point3(to) - moved).normalize();
                let other = depth(&there, moved, towards);
                assert!(far(own_depth, other) < 2e-3, "{own_depth} {other}");
                // The other way round.
                let behind = moved + towards * 200.0;
                assert!(far(own_depth, depth(&there, behind, -towards)) < 4e-3);
            }
        }
        // Planted: a longer volume is denser along itself.
        let longer = alone(&own, Mat4::from_scale(Vec3::new(1.0, 1.0, 1.0)) * Mat4::from_translation(Vec3::X * 0.2));
        let differ = |y: f32| {
            far(depth(&here, Vec3::new(0.31, y, -1.0), Vec3::Z), depth(&longer, Vec3::new(0.31, y, -1.0), Vec3::Z))
        };
        assert!((0..30).map(|i| differ(i as f32 / 30.0)).fold(0.0, f32::max) > 0.1);
    }

    #[test]
    fn volumes_that_overlap_hide_what_both_hide_and_an_eye_may_be_inside() {
        let (first, second) = (voltex(5), voltex(6));
        let map = Mat4::from_rotation_translation(Quat::from_rotation_y(0.4), Vec3::new(0.3, 0.1, -0.2));
        let places = [
            VolumePlace { volume: 0, world_from_volume: Mat4::IDENTITY, leaf_width: 0.0 },
            VolumePlace { volume: 1, world_from_volume: map, leaf_width: 0.0 },
        ];
        let both = Volumes::new(vec![first.clone(), second.clone()], &places, Vec::new()).unwrap();
        let (a, b) = (alone(&first, Mat4::IDENTITY), alone(&second, map));
        let mut random = Random::new(4);
        let mut inside = 0;
        for i in 0..400 {
            let origin = Vec3::splat(0.5) + direction(&mut random) * if i % 2 == 0 { 0.3 } else { 2.0 };
            let towards = (Vec3::splat(0.5) + direction(&mut random) * 0.4 - origin).normalize();
            let sum = depth(&a, origin, towards) + depth(&b, origin, towards);
            assert!(far(sum, depth(&both, origin, towards)) < 3e-3);
            let mut weights = 0.0;
            let through =
                both.march(origin, towards, 1e30, &LodTransition::MESHES, |_| 0.0, |point| weights += point.weight);
            assert!((through - (-sum).exp()).abs() < 0.01 && (weights + through - 1.0).abs() < 0.01);
            // What lies beyond t_max hides nothing.
            assert!(both.depth(origin, towards, 0.2, &LodTransition::MESHES, 0.0) <= sum + 1e-3);
            inside += usize::from(i % 2 == 0 && sum > 0.1);
        }
        assert!(inside > 20, "{inside}");
        // Planted: one alone hides less.
        let ray = |volumes: &Volumes| depth(volumes, Vec3::new(0.5, 0.45, -3.0), Vec3::Z).min(9.0);
        assert!(ray(&both) > ray(&a) || ray(&both) > ray(&b));
    }

    #[test]
    fn volumes_that_stand_in_for_meshes_are_there_beyond_their_spheres_alone() {
        let own = voltex(5);
        let places = [(0.0, 0.0), (0.6, 0.3), (1.3, 0.6)].map(|(x, leaf_width)| VolumePlace {
            volume: 0,
            // No two faces lie in one plane.
            world_from_volume: Mat4::from_translation(Vec3::new(x, 0.11 * x, 0.07 * x)),
            leaf_width,
        });
        let all = Volumes::new(vec![own.clone()], &places, Vec::new()).unwrap();
        let apart = places.map(|place| Volumes::new(vec![own.clone()], &[place], Vec::new()).unwrap());
        let mut random = Random::new(21);
        let mut counts = [0; 3];
        for i in 0..300 {
            let eye = Vec3::new(0.9, 0.5, 0.5) + direction(&mut random) * random.within(0.0, 1.0);
            let lod_transition = LodTransition::new(eye, 0.5, random.within(0.0, 1.0));
            let target = Vec3::new(random.within(0.0, 2.0), 0.5, 0.5);
            let origin = if i % 2 == 0 { eye } else { target + direction(&mut random) * 3.0 };
            let towards = (target - origin).normalize();
            // What a volume has on the parts of the ray that are beyond its sphere, asked for one by one.
            let mut expected = 0.0;
            for (number, (volumes, place)) in apart.iter().zip(&places).enumerate() {
                let whole = depth(volumes, origin, towards);
                let spheres = lod_transition.along(origin, towards);
                let beyond: f32 = spheres
                    .volume(place.leaf_width, [0.0, 30.0])
                    .into_iter()
                    .filter(|[t0, t1]| t0 < t1)
                    .map(|[t0, t1]| {
                        let kept =
                            Volumes::new(vec![own.clone()], &[VolumePlace { leaf_width: 0.0, ..*place }], Vec::new());
                        kept.unwrap().depth(origin + t0 * towards, towards, t1 - t0, &LodTransition::MESHES, 0.0)
                    })
                    .sum();
                assert!(place.leaf_width == 0.0 || whole == 0.0, "every mesh is one");
                counts[number] += usize::from(beyond > 0.1);
                expected += beyond;
            }
            let found = all.depth(origin, towards, 1e30, &lod_transition, 0.0);
            assert!(far(expected, found) < 6e-3, "{expected} {found}");
            // What the eye sees is hidden by the same.
            let through = all.march(origin, towards, 1e30, &lod_transition, |_| 0.0, |_| ());
            assert!(far(-through.max(1e-9).ln(), found) < 6e-3);
        }
        assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
    }

    #[test]
    fn a_ray_to_a_light_that_ends_by_chance_passes_as_much_in_the_mean_and_goes_less_far() {
        let volumes = alone(&voltex(5), Mat4::from_scale(Vec3::splat(3.0)));
        const CHANCES: usize = 4000;
        let mut random = Random::new(12);
        let mut dark = 0;
        for _ in 0..60 {
            let from = Vec3::splat(1.5) + direction(&mut random) * 3.0;
            let towards = (Vec3::splat(1.5) + direction(&mut random) - from).normalize();
            let ray = LightRay { origin: from, direction: towards, t_max: 1e30, width: 0.0 };
            let factor = random.within(0.2, 6.0);
            let share = |chance| volumes.light_share(&ray, &LodTransition::MESHES, factor, chance);
            let shares: Vec<f32> = (0..CHANCES).map(|i| share((i as f32 + 0.5) / CHANCES as f32)).collect();
            let whole = (-factor * depth(&volumes, from, towards)).exp();
            let mean = shares.iter().sum::<f32>() / CHANCES as f32;
            assert!((mean - whole).abs() < 1e-3, "{mean} {whole}");
            assert!(shares.iter().all(|share| *share == 0.0 || *share >= ROULETTE));
            // Planted: what ends at the share itself would be too dark.
            let ended = if whole < ROULETTE { 0.0 } else { whole };
            dark += usize::from(whole > 0.01 && (ended - whole).abs() > 1e-3);
        }
        assert!(dark > 5, "{dark}");
        // No ray goes on for less light than can be seen, and few where it is dark.
        assert!(most_depth(1.0, 0.0) < 8.0 && most_depth(2.0, 0.5) < 1.0);
    }

    #[test]
    fn a_flat_skin_is_a_row_of_boxes() {
        let own = voltex(6);
        let vertex = |x: u32, y: u32| {
            let at = [x as f32, y as f32];
            SkinVertex::new(Vec3::new(at[0], 0.0, -at[1]), Vec3::Y, at)
        };
        let skin = Skin::from_grid(3, 2, vertex, |_, _| 0).unwrap();
        let skin = SceneSkin::new(skin, &ShellParams::default(), vec![Pattern::cyclic(0)], 0.0).unwrap();
        let skins = Volumes::new(vec![own.clone()], &[], vec![skin]).unwrap();
        // The volume's z is the world's y.
        let y_up =
            Mat4::from_cols(Vec3::X.extend(0.0), Vec3::NEG_Z.extend(0.0), Vec3::Y.extend(0.0), Vec3::ZERO.extend(1.0));
        let places: Vec<VolumePlace> = (0..6)
            .map(|i| Vec3::new((i % 3) as f32, 0.0, -((i / 3) as f32)))
            .map(|at| VolumePlace { volume: 0, world_from_volume: Mat4::from_translation(at) * y_up, leaf_width: 0.0 })
            .collect();
        let boxes = Volumes::new(vec![own], &places, Vec::new()).unwrap();
        let mut random = Random::new(11);
        for _ in 0..500 {
            let to = Vec3::new(random.within(0.1, 2.9), random.within(0.1, 0.9), random.within(-1.9, -0.1));
            let towards = direction(&mut random);
            let from = to - towards * random.within(0.0, 5.0);
            let (a, b) = (depth(&skins, from, towards), depth(&boxes, from, towards));
            assert!(far(a, b) < 5e-3, "{a} {b} from {from} along {towards}");
        }
    }

    #[test]
    fn skins_are_entered_by_the_shell_of_the_distance_from_the_eye_and_nothing_of_them_is_missing_or_twice() {
        let vertex = |x: u32, y: u32| {
            let at = [x as f32, y as f32];
            let lean = Vec3::new((1.7 * at[0]).sin() * 0.3, 1.0, (1.3 * at[1] + at[0]).cos() * 0.3);
            SkinVertex::new(Vec3::new(at[0], 0.0, -at[1]), lean, at)
        };
        let skin = Skin::from_grid(6, 6, vertex, |_, _| 0).unwrap();
        let params = ShellParams { tolerance: 0.01, ..ShellParams::default() };
        let skin = SceneSkin::new(skin, &params, vec![Pattern::cyclic(0)], 0.0).unwrap();
        let counts: Vec<usize> = skin.levels.iter().map(|level| level.shell.tets().len()).collect();
        assert!(counts.len() >= 3 && counts.is_sorted_by(|finer, coarser| coarser < finer), "{counts:?}");
        let widths: Vec<f32> = skin.levels.iter().map(|level| level.from_width).collect();
        let alone = |level: usize| {
            let levels = vec![ShellLevel { from_width: 0.0, ..skin.levels[level].clone() }];
            Volumes::new(vec![voltex(3)], &[], vec![SceneSkin { levels, ..skin.clone() }]).unwrap()
        };
        let alone: Vec<Volumes> = (0..widths.len()).map(alone).collect();
        let all = Volumes::new(vec![voltex(3)], &[], vec![skin.clone()]).unwrap();
        let is_within = |volumes: &Volumes, stretch: &Stretch, point: Vec3| {
            let SkinTet { skin, level, tet } = stretch.within.unwrap();
            let shell = &volumes.skins()[skin].levels[level].shell;
            (0..4).all(|face| {
                let [a, b, c] = shell.face(4 * tet + face).map(|i| shell.positions()[i as usize]);
                (b - a).cross(c - a).normalize_or_zero().dot(point - a) < 1e-3
            })
        };
        // The ray's length in the skin, and how much of that is told twice.
        let length = |volumes: &Volumes, from, towards, lod: &LodTransition| {
            let (mut end, mut sums) = (0f32, [0f64; 2]);
            for stretch in volumes.stretches(from, towards, 30.0, lod) {
                assert!(is_within(volumes, &stretch, from + 0.5 * (stretch.t0 + stretch.t1) * towards));
                sums[0] += f64::from(stretch.t1 - stretch.t0);
                sums[1] += f64::from((end - stretch.t0).max(0.0));
                end = stretch.t1;
            }
            sums
        };
        let mut random = Random::new(5);
        // Rays of which a level is seen alone, rays through several; and of these lengths, what is told twice, and lengths by the finest.
        let (mut seen, mut mixed, mut sums) = (vec![0; widths.len()], 0, [0.0; 3]);
        for _ in 0..3000 {
            let to = Vec3::new(random.within(0.5, 5.5), random.within(0.1, 0.9), random.within(-5.5, -0.5));
            let mut from = to + random.within(0.1, 3.0) * direction(&mut random);
            let towards = (to - from).normalize();
            // At the ray's origin, or elsewhere as for rays to lights: near by, or so far away that all is one level.
            let eye = match random.below(3) {
                0 => from,
                1 => from + direction(&mut random),
                _ => {
                    from = to - 0.3 * towards;
                    to + 40.0 * direction(&mut random)
                }
            };
            let widest = widths[widths.len() - 1];
            let far = (to - eye).length();
            let pixel_width = 0.3 * widths[1] / far * (10.0 * widest / widths[1]).powf(random.within(0.0, 1.0));
            let lod = LodTransition::new(eye, pixel_width, 0.5);
            let radius = |width: f32| lod.along(eye, Vec3::X).mesh(width)[1];
            // From the nearest to the farthest place that the ray may have in the skin.
            let closest = (eye - from).dot(towards).clamp(0.0, 8.0);
            let nearest = (from + closest * towards).distance(eye);
            let farthest = [0.0, 8.0].map(|t| (from + t * towards).distance(eye)).into_iter().fold(0.0, f32::max);
            let level = |distance: f32| widths.iter().rposition(|w| *w == 0.0 || radius(*w) < distance).unwrap();
            let [found, twice] = length(&all, from, towards, &lod);
            if level(nearest) == level(farthest) {
                assert_eq!([found, twice], length(&alone[level(nearest)], from, towards, &lod));
                seen[level(nearest)] += usize::from(found > 0.0);
            } else {
                mixed += usize::from(found > 0.0);
                let [of_finest, _] = length(&alone[0], from, towards, &lod);
                sums = [sums[0] + found, sums[1] + twice, sums[2] + of_finest];
            }
        }
        assert!(mixed > 500 && seen.iter().all(|count| *count > 100), "{mixed} {seen:?}");
        assert!((sums[0] / sums[2] - 1.0).abs() < 0.01 && sums[1] < 0.01 * sums[2], "{sums:?}");
    }
}
