//! The volumetric textures of a scene: free instances and thick skins, and the stretches of a ray within them. Twin:
//! `volumes.wgsl`.

use crate::geometry::bvh::{Fronts, Hit, NO_HIT};
use crate::geometry::geometry::{Geometry, Mesh, Placement, Triangle, Vertex};
use crate::geometry::lod_transition::{LodTransition, SpheresAlong};
use crate::volume::skin::{
    CellWalk, Merged, NO_VOLUME, Pattern, Shell, ShellLevel, ShellParams, Skin, SkinPlace, TextureRay, Variant,
    Walk as ShellWalk, Wind,
};
use crate::volume::source::{BrickLevels, LoadedBricks, VolumeSource};
use btf_runtime::voltex::{Voltex, VoltexRay};
use glam::{Mat3, Mat4, Vec3};
use std::sync::Arc;

/// The place of a volume that stands on its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumePlace {
    /// Number of the volume.
    pub volume: usize,
    /// Map from the unit cube of the volume, whose z points up, to the world. Invertible.
    pub world_from_volume: Mat4,
    /// Width of the leaves of the mesh that the volume stands in for, in the world; 0 where there is none.
    pub leaf_width: f32,
}

/// A thick skin with what is mapped on it.
#[derive(Debug, Clone)]
pub struct SceneSkin {
    /// The skin at rest.
    pub rest: Skin,
    /// The tetrahedra of the skin, where the wind has moved them: shells from fine to coarse, one at least.
    pub levels: Vec<ShellLevel>,
    /// Patterns that the faces of the skin name.
    pub patterns: Vec<Pattern>,
    /// Width of the leaves of the meshes that the skin stands in for, in the world; 0 where there are none.
    pub leaf_width: f32,
}

impl SceneSkin {
    /// Returns a skin at rest with shells for all distances, whose finest is what `params` ask for. Cost: that of a few shells.
    ///
    /// # Errors
    /// As [`Shell::new`].
    pub fn new(rest: Skin, params: &ShellParams, patterns: Vec<Pattern>, leaf_width: f32) -> Result<SceneSkin, String> {
        Ok(SceneSkin { levels: ShellLevel::all(&rest, params)?, rest, patterns, leaf_width })
    }

    /// Returns the finest shell.
    ///
    /// # Panics
    /// If there is no level.
    pub fn shell(&self) -> &Shell {
        &self.levels[0].shell
    }

    /// Returns the widths in the world about whose spheres a level begins and ends to be entered; 0 where it begins at the eye, or does
    /// not end.
    pub(crate) fn widths(&self, level: usize) -> [f32; 2] {
        [self.levels[level].from_width, self.levels.get(level + 1).map_or(0.0, |level| level.from_width)]
    }
}

/// All volumes of a scene.
#[derive(Debug, Clone)]
pub struct Volumes {
    volumes: Vec<Arc<Voltex>>,
    /// Where the bricks of each volume are, of those that are stored by brick, and the levels that are loaded.
    sources: Vec<Option<(Arc<VolumeSource>, BrickLevels)>>,
    skins: Vec<SceneSkin>,
    /// The scene's first placement that the first skin has somewhere, and where it has that and those behind it.
    stand_ins: (usize, Vec<SkinPlace>),
    /// The proxies that rays enter: a box for each volume that stands on its own, and the outer faces of each skin.
    proxies: Geometry,
    /// The kind of each mesh of `proxies`.
    kinds: Vec<Proxy>,
    /// Length of the longest box's sides together.
    reach_of_boxes: f32,
    /// Length of the slices in which overlapping volumes are taken.
    slice: f32,
}

/// The content that a mesh of the proxies stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Proxy {
    /// A volume on its own.
    Box(usize),
    /// A level of a skin.
    Skin {
        /// Number of the skin.
        skin: usize,
        /// Number of the level.
        level: usize,
    },
}

/// A tetrahedron of a scene's skins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinTet {
    /// Number of the skin.
    pub skin: usize,
    /// Number of its shell, from the finest on.
    pub level: usize,
    /// Number of the tetrahedron.
    pub tet: u32,
}

/// A part of a ray within one volume.
#[derive(Debug, Clone, Copy)]
pub struct Stretch {
    /// Begin of the stretch, along the ray.
    pub t0: f32,
    /// End of the stretch, along the ray.
    pub t1: f32,
    /// Number of the volume.
    pub volume: usize,
    /// The ray in the volume, from `start` on.
    pub ray: VoltexRay,
    /// Origin of `ray`, along the world's ray.
    pub start: f32,
    /// Directions of the volume from those of the world.
    pub volume_from_world: Mat3,
    /// Width of the leaves of the mesh that the volume stands in for, in the world; 0 where there is none.
    pub leaf_width: f32,
    /// The tetrahedron that the volume is mapped by; `None` where it stands on its own.
    pub within: Option<SkinTet>,
}

/// Returns a corner of the unit cube; bit i of the number is coordinate i.
fn cube_corner(number: usize) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| (number >> axis & 1) as f32))
}

/// Triangles of the unit cube, counter-clockwise from outside.
const CUBE: [[u32; 3]; 12] = [
    [0, 2, 3],
    [0, 3, 1],
    [4, 5, 7],
    [4, 7, 6],
    [0, 1, 5],
    [0, 5, 4],
    [2, 6, 7],
    [2, 7, 3],
    [0, 4, 6],
    [0, 6, 2],
    [1, 3, 7],
    [1, 7, 5],
];

fn plain_vertex(position: Vec3) -> Vertex {
    Vertex { position: position.into(), u: 0.0, normal: [0.0, 0.0, 1.0], v: 0.0, tangent: [1.0, 0.0, 0.0, 1.0] }
}

/// Overlapping volumes are taken in turn in slices of this share of the largest volume's diagonal, or of the thickest
/// skin.
const SLICE: f32 = 1.0 / 8.0;
/// Volumes and skins that a ray is in at once: it enters no further one before it has left one of those. What overlaps
/// five times is met in a slightly other order, and nothing is left out.
pub(crate) const MAX_PASSAGES: usize = 4;

impl Volumes {
    /// Returns volumes that stand on their own, and skins; one of either at least.
    ///
    /// # Errors
    /// A sentence for numbers out of range and for maps that cannot be inverted.
    pub fn new(volumes: Vec<Arc<Voltex>>, places: &[VolumePlace], skins: Vec<SceneSkin>) -> Result<Volumes, String> {
        let named = |volume: usize| volume < volumes.len();
        let in_skins =
            skins.iter().flat_map(|skin| &skin.patterns).flat_map(|pattern| pattern.alternatives.as_flattened());
        let all_named = places.iter().all(|place| named(place.volume))
            && in_skins.clone().all(|volume| *volume == NO_VOLUME || named(*volume as usize));
        if !all_named {
            return Err("a volume is named that is not there".into());
        }
        let (mut meshes, mut placements, mut kinds) = (Vec::new(), Vec::new(), Vec::new());
        for volume in 0..volumes.len() {
            let triangles = CUBE.iter().map(|vertices| Triangle { vertices: *vertices, material: 0 }).collect();
            meshes.push(Mesh { vertices: (0..8).map(|i| plain_vertex(cube_corner(i))).collect(), triangles });
            kinds.push(Proxy::Box(volume));
        }
        let mut largest = 0f32;
        for place in places {
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| place.world_from_volume.transform_vector3(axis));
            largest = largest.max(x.length() + y.length() + z.length());
            placements.push(Placement { mesh: place.volume, world_from_object: place.world_from_volume });
        }
        let reach_of_boxes = largest;
        for (number, skin) in skins.iter().enumerate() {
            skin.patterns.iter().try_for_each(Pattern::check)?;
            if skin.levels.is_empty() {
                return Err("a skin has no shell".into());
            }
            for (level, ShellLevel { shell, .. }) in skin.levels.iter().enumerate() {
                let triangle =
                    |(i, link): (u32, &u32)| Triangle { vertices: [0, 1, 2].map(|k| 3 * i + k), material: *link };
                let triangles = (0..).zip(shell.boundary()).map(triangle).collect();
                placements.push(Placement { mesh: meshes.len(), world_from_object: Mat4::IDENTITY });
                meshes.push(Mesh { vertices: shell.boundary_corners().map(plain_vertex).collect(), triangles });
                kinds.push(Proxy::Skin { skin: number, level });
            }
            largest = largest.max(skin.rest.thickness());
        }
        let mut proxies = Geometry::placed(meshes, &placements)?;
        proxies.set_leaf_widths(|mesh, number| match kinds[mesh] {
            Proxy::Box(_) => places[number].leaf_width,
            Proxy::Skin { skin, .. } => skins[skin].leaf_width,
        });
        let stand_ins = (0, Vec::new());
        let sources = vec![None; volumes.len()];
        Ok(Volumes { volumes, sources, skins, stand_ins, proxies, kinds, reach_of_boxes, slice: SLICE * largest })
    }

    /// Multiplies the widths of the leaves of all meshes that the volumes stand in for.
    pub(crate) fn scale_leaf_widths(&mut self, factor: f32) {
        self.skins.iter_mut().for_each(|skin| skin.leaf_width *= factor);
        self.proxies.scale_leaf_widths(factor);
    }

    /// Moves the skins to where a wind has them at a time, seconds. Cost: some noises a vertex of the skins, and a pass
    /// over their shells.
    ///
    /// # Errors
    /// As [`Wind::displace`].
    pub fn advance_wind(&mut self, wind: &Wind, time_s: f64) -> Result<(), String> {
        for skin in &mut self.skins {
            let displaced = wind.displace(&skin.rest, time_s)?;
            skin.levels.iter_mut().try_for_each(|level| level.shell.refresh(&displaced))?;
        }
        let shells = || self.skins.iter().flat_map(|skin| &skin.levels).map(|level| &level.shell);
        // The boxes' corners come first.
        let first = self.proxies.vertices().len() - shells().map(|shell| 3 * shell.boundary().len()).sum::<usize>();
        self.proxies.move_vertices(first, shells().flat_map(Shell::boundary_corners));
        Ok(())
    }

    /// Says where the bricks of the volumes are, none for those that are stored whole.
    pub(crate) fn set_sources(&mut self, sources: Vec<Option<Arc<VolumeSource>>>) {
        self.sources = sources.into_iter().map(|source| Some((source?, BrickLevels::default()))).collect();
    }

    /// Iterates over the volumes that are stored by brick: number, file, and the levels that are loaded.
    pub(crate) fn sources(&self) -> impl Iterator<Item = (usize, &Arc<VolumeSource>, &BrickLevels)> {
        self.sources.iter().enumerate().filter_map(|(number, source)| {
            let (source, loaded) = source.as_ref()?;
            Some((number, source, loaded))
        })
    }

    /// Takes bricks over that are loaded.
    pub(crate) fn take_bricks(&mut self, loaded: LoadedBricks) {
        for (number, volume, levels) in loaded.0 {
            self.volumes[number] = volume;
            if let Some((_, own)) = &mut self.sources[number] {
                *own = levels;
            }
        }
    }

    /// Says where the first skin has what the scene's placements from number `first` on place.
    pub(crate) fn set_stand_ins(&mut self, first: usize, places: Vec<SkinPlace>) {
        self.stand_ins = (first, places);
    }

    pub(crate) fn has_stand_ins(&self) -> bool {
        !self.stand_ins.1.is_empty()
    }

    /// Returns where the skin has what a placement of the scene places; none for what stands still.
    pub(crate) fn stand_in_place(&self, placement: usize) -> Option<Mat4> {
        let (first, places) = &self.stand_ins;
        let place = places.get(placement.checked_sub(*first)?)?;
        Some(place.world_from_object(self.skins.first()?.shell()))
    }

    /// Returns a volume by its number.
    pub fn volume(&self, number: usize) -> &Voltex {
        &self.volumes[number]
    }

    /// Returns how many volumes there are.
    pub(crate) fn volume_count(&self) -> usize {
        self.volumes.len()
    }

    /// Returns the skins.
    pub fn skins(&self) -> &[SceneSkin] {
        &self.skins
    }

    /// Returns what rays enter. The material of a triangle is the face of its skin's shell.
    pub(crate) fn proxies(&self) -> &Geometry {
        &self.proxies
    }

    /// Returns what an instance of the proxies stands for.
    pub(crate) fn proxy(&self, instance: usize) -> Proxy {
        self.kinds[self.proxies.mesh_of(instance)]
    }

    /// Returns how far before its origin a ray may have entered what it is in.
    pub(crate) fn reach(&self) -> f32 {
        // A ray along the land may have been within the skin all the way.
        let of_shell = |mesh: usize| {
            let [least, most] = self.proxies.mesh_bounds(mesh);
            (most - least).max(Vec3::ZERO).length()
        };
        (self.volumes.len()..self.kinds.len()).map(of_shell).fold(self.reach_of_boxes, f32::max)
    }

    /// Returns the length of the slices in which overlapping volumes are taken.
    pub(crate) fn slice(&self) -> f32 {
        self.slice
    }

    /// Counts the volumes that stand on their own, and the skins.
    pub fn counts(&self) -> [usize; 2] {
        let shells = self.skins.iter().map(|skin| skin.levels.len()).sum::<usize>();
        [self.proxies.instances().len().saturating_sub(shells), self.skins.len()]
    }

    /// Returns the centre and radius of a sphere around them.
    pub fn bounding_sphere(&self) -> (Vec3, f32) {
        self.proxies.bounding_sphere()
    }

    /// Tells whether an instance of the proxies is one of several shells of a skin.
    pub(crate) fn is_one_of_several(&self, instance: usize) -> bool {
        matches!(self.proxy(instance), Proxy::Skin { skin, .. } if self.skins[skin].levels.len() > 1)
    }

    /// Tells whether skins have several shells, of which distance decides.
    pub(crate) fn has_levels(&self) -> bool {
        self.skins.iter().any(|skin| skin.levels.len() > 1)
    }

    /// Iterates over the stretches of a ray between 0 and `t_max`, in the order in which they begin. Skins are entered by the shells that
    /// `lod_transition` has there.
    pub fn stretches(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        lod_transition: &LodTransition,
    ) -> Stretches<'_> {
        let open = [const { None }; MAX_PASSAGES];
        let reach = self.reach();
        let mut stretches = Stretches {
            volumes: self,
            origin,
            direction,
            t_max,
            spheres: lod_transition.along(origin, direction),
            from: -reach,
            reach,
            entry: None,
            open,
            most: MAX_PASSAGES,
        };
        stretches.find_entry();
        stretches
    }

    /// Iterates over the stretches of a ray volume by volume, for sums that need no order.
    pub(crate) fn stretches_in_turn(
        &self,
        origin: Vec3,
        direction: Vec3,
        t_max: f32,
        lod_transition: &LodTransition,
    ) -> Stretches<'_> {
        Stretches { most: 1, ..self.stretches(origin, direction, t_max, lod_transition) }
    }
}

/// A way through one volume or skin.
enum Passage<'a> {
    Box,
    Skin(Box<SkinPassage<'a>>),
}

/// A way through a skin.
struct SkinPassage<'a> {
    skin: &'a SceneSkin,
    shell: &'a Shell,
    /// The latest tetrahedron.
    within: SkinTet,
    walk: ShellWalk<'a>,
    cells: Option<Cells>,
    /// The latest texel, by its pattern, and its content: tetrahedra that follow each other share it.
    texel: Option<(u32, [i32; 2], Option<Variant>)>,
}

/// The texels within one tetrahedron.
struct Cells {
    walk: CellWalk,
    ray: TextureRay,
    start: f32,
    gradients: [Vec3; 3],
    pattern: u32,
    /// The stretch of the latest texel, and its volumes that are still to be told.
    told: Option<(Stretch, Merged)>,
}

impl Cells {
    /// Returns the stretch of the latest texel in its next volume.
    fn merged(&mut self) -> Option<Stretch> {
        let (stretch, volumes) = self.told.as_mut()?;
        let last = volumes.iter_mut().rev().find(|volume| **volume != NO_VOLUME)?;
        stretch.volume = std::mem::replace(last, NO_VOLUME) as usize;
        Some(*stretch)
    }
}

/// Iterator over the stretches of a ray.
pub struct Stretches<'a> {
    volumes: &'a Volumes,
    origin: Vec3,
    direction: Vec3,
    t_max: f32,
    spheres: SpheresAlong,
    /// See [`Volumes::reach`].
    reach: f32,
    /// Entries are looked for from here on.
    from: f32,
    entry: Option<(f32, Hit)>,
    /// Volumes and skins that the ray is in.
    open: [Option<(Stretch, Passage<'a>)>; MAX_PASSAGES],
    /// Volumes and skins that the ray may be in at once.
    most: usize,
}

impl<'a> Stretches<'a> {
    /// Iterates over the parts of the stretches in which volumes that stand in for meshes exist: beyond the spheres of the transition only.
    pub(crate) fn beyond_mesh(self) -> impl Iterator<Item = Stretch> + use<'a> {
        let spheres = self.spheres;
        self.flat_map(move |stretch| {
            let parts = spheres.volume(stretch.leaf_width, [stretch.t0, stretch.t1]);
            parts.into_iter().filter(|[t0, t1]| t0 < t1).map(move |[t0, t1]| Stretch { t0, t1, ..stretch })
        })
    }

    /// Finds the next face that the ray enters by.
    fn find_entry(&mut self) {
        self.entry = None;
        if self.from >= self.t_max {
            return;
        }
        let start = self.origin + self.direction * self.from;
        // Fronts alone: where volumes stand side by side, one is left by the face by which the next is entered.
        let hit = self.volumes.proxies.trace_fronts(start, self.direction, self.t_max - self.from, self);
        if hit.primitive == NO_HIT {
            self.from = self.t_max;
            return;
        }
        let t = self.from + hit.t;
        // Beyond what this number and the origin's are rounded to.
        self.from = t + 2e-6 * (self.reach + self.origin.abs().max_element() + t.abs());
        self.entry = Some((t, hit));
    }

    /// Returns the passage into what was found.
    fn enter(&self, (t, hit): (f32, Hit)) -> Option<(Stretch, Passage<'a>)> {
        let volumes = self.volumes;
        match volumes.proxy(hit.instance as usize) {
            Proxy::Box(volume) => {
                let instance = &volumes.proxies.instances()[hit.instance as usize];
                let start = t.max(0.0);
                let origin = instance.object_from_world(self.origin + self.direction * start, 1.0);
                let direction = instance.object_from_world(self.direction, 0.0);
                let exit = (0..3)
                    .map(|axis| {
                        let plane = if direction[axis] > 0.0 { 1.0 } else { 0.0 };
                        if direction[axis] == 0.0 { f32::INFINITY } else { (plane - origin[axis]) / direction[axis] }
                    })
                    .fold(f32::INFINITY, f32::min);
                let rows = instance.object_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z));
                let stretch = Stretch {
                    t0: start,
                    t1: (start + exit).min(self.t_max),
                    volume,
                    ray: VoltexRay { origin: origin.into(), direction: direction.into() },
                    start,
                    volume_from_world: Mat3::from_cols(rows[0], rows[1], rows[2]).transpose(),
                    leaf_width: instance.leaf_width,
                    within: None,
                };
                (stretch.t1 > stretch.t0).then_some((stretch, Passage::Box))
            }
            Proxy::Skin { skin, level } => {
                let within = SkinTet { skin, level, tet: 0 };
                let skin = &volumes.skins[skin];
                let shell = &skin.levels[level].shell;
                let link = volumes.proxies.triangles()[hit.primitive as usize].material;
                let walk = shell.enter(self.origin, self.direction, link, t.max(0.0), self.t_max);
                self.advance(Passage::Skin(Box::new(SkinPassage {
                    skin,
                    shell,
                    within,
                    walk,
                    cells: None,
                    texel: None,
                })))
            }
        }
    }

    /// Advances a passage to its next stretch.
    fn advance(&self, passage: Passage<'a>) -> Option<(Stretch, Passage<'a>)> {
        let Passage::Skin(mut way) = passage else { return None };
        let SkinPassage { skin, shell, within, walk, cells, texel } = &mut *way;
        loop {
            if let Some(own) = cells {
                if let Some(stretch) = own.merged() {
                    return Some((stretch, Passage::Skin(way)));
                }
                if let Some(span) = own.walk.next() {
                    let pattern = &skin.patterns[own.pattern as usize];
                    let variant = match *texel {
                        Some((of_pattern, cell, variant)) if of_pattern == own.pattern && cell == span.cell => variant,
                        _ => pattern.variant(span.cell),
                    };
                    *texel = Some((own.pattern, span.cell, variant));
                    let Some(variant) = variant else { continue };
                    let ray = variant.ray(own.ray);
                    let [[a, b], [c, d]] = variant.rows;
                    let [u, v, w] = own.gradients;
                    let rows = [a * u + b * v, c * u + d * v, variant.upright * w];
                    let stretch = Stretch {
                        t0: span.t0,
                        t1: span.t1,
                        volume: 0,
                        ray: VoltexRay { origin: ray.point.into(), direction: ray.direction.into() },
                        start: own.start,
                        volume_from_world: Mat3::from_cols(rows[0], rows[1], rows[2]).transpose(),
                        leaf_width: skin.leaf_width,
                        within: Some(*within),
                    };
                    own.told = Some((stretch, pattern.alternatives[variant.alternative as usize]));
                    continue;
                }
            }
            let interval = walk.next()?;
            within.tet = interval.tet;
            let map = shell.map(interval.tet);
            let ray = map.ray(self.origin, self.direction, interval.t0);
            *cells = Some(Cells {
                walk: CellWalk::new(ray, interval.t0, interval.t1),
                ray,
                start: interval.t0,
                gradients: map.gradients,
                pattern: shell.tets()[interval.tet as usize].pattern,
                told: None,
            });
        }
    }

    /// Returns the widths about whose spheres a proxy begins and ends to be entered; 0 for no sphere.
    fn widths(&self, instance: u32) -> [f32; 2] {
        match self.volumes.proxy(instance as usize) {
            Proxy::Box(_) => [0.0; 2],
            Proxy::Skin { skin, level } => self.volumes.skins[skin].widths(level),
        }
    }
}

/// The fronts of proxies, along the ray from `from` on: of a skin's shells one is there to be entered, by the distance from the eye. What was
/// entered before the ray began is entered by the shell of where it began, so shells do not hide each other.
impl Fronts for Stretches<'_> {
    fn range(&self, instance: u32) -> [f32; 2] {
        let [from_width, to_width] = self.widths(instance);
        let [begin, end] = self.spheres.range_between(from_width, to_width, 0.0);
        match (begin <= 0.0, end <= 0.0) {
            (_, true) => [0.0, 0.0],
            // Before the ray began as well.
            (true, false) => [0.0, end - self.from],
            (false, false) => [begin - self.from, end - self.from],
        }
    }

    fn is_there(&self, instance: u32, t: f32) -> bool {
        let [from_width, to_width] = self.widths(instance);
        self.spheres.is_between(from_width, to_width, (self.from + t).max(0.0))
    }
}

impl Iterator for Stretches<'_> {
    type Item = Stretch;

    fn next(&mut self) -> Option<Stretch> {
        loop {
            let begin = |slot: usize| self.open[slot].as_ref().map_or(f32::INFINITY, |(stretch, _)| stretch.t0);
            let first = (0..self.most).min_by(|a, b| begin(*a).total_cmp(&begin(*b)))?;
            let free = (0..self.most).find(|slot| self.open[*slot].is_none());
            let entry = self.entry.filter(|_| free.is_some());
            if let (Some(entry), Some(free)) = (entry, free)
                && entry.0 <= begin(first)
            {
                self.open[free] = self.enter(entry);
                self.find_entry();
                continue;
            }
            let others = (0..self.most).filter(|slot| *slot != first).map(begin);
            let next = others.chain(entry.map(|(t, _)| t)).fold(f32::INFINITY, f32::min);
            let (own, passage) = self.open[first].take()?;
            // What begins within this stretch is taken in turn with it.
            let cut = next.max(own.t0 + self.volumes.slice);
            if self.most > 1 && cut < own.t1 {
                self.open[first] = Some((Stretch { t0: cut, ..own }, passage));
                return Some(Stretch { t1: cut, ..own });
            }
            self.open[first] = self.advance(passage);
            return Some(own);
        }
    }
}
