//! Skins for tests.

use super::shell::Shell;
use super::thick_skin::{Skin, SkinVertex};
use super::walk::Interval;
use btf_runtime::testing::Random;
use glam::{DVec3, Vec3};

/// Returns a flat skin of unit patches, one texel each, one high.
pub(super) fn grid(columns: u32, rows: u32) -> Skin {
    let vertex = |x: u32, y: u32| {
        let [x, y] = [x as f32, y as f32];
        SkinVertex::new(Vec3::new(x, y, 0.0), Vec3::Z, [x, y])
    };
    Skin::from_grid(columns, rows, vertex, |_, _| 0).unwrap()
}

/// Returns a skin of unit patches lifted to a hill whose patches are twisted, with height vectors combed this way and
/// that.
pub(super) fn twisted(side: u32) -> Skin {
    grid(side, side).with_vertices(|vertex| {
        let Vec3 { x, y, .. } = vertex.position;
        let height = Vec3::new(0.3 * (1.7 * y).sin(), 0.3 * (2.3 * x).cos(), 0.8 + 0.2 * (x + y).sin());
        SkinVertex { position: vertex.position + Vec3::Z * 0.5 * (x * 1.1).sin() * (y * 0.9).cos(), height, ..*vertex }
    })
}

/// Returns a flat skin with height vectors that lean.
pub(super) fn sheared(side: u32) -> Skin {
    grid(side, side).with_vertices(|vertex| SkinVertex { height: Vec3::new(0.4, -0.7, 0.5), ..*vertex })
}

/// Returns a skin of unit texels with height vectors that lean apart and together by up to 40 degrees.
pub(super) fn combed(side: u32) -> Skin {
    grid(side, side).with_vertices(|vertex| {
        let Vec3 { x, y, .. } = vertex.position;
        SkinVertex { height: Vec3::new(0.7 * (0.9 * x).sin(), 0.4 * (1.3 * y + x).cos(), 1.0), ..*vertex }
    })
}

/// Scales a skin.
pub(super) fn scaled(skin: &Skin, size: f32, thickness: f32) -> Skin {
    skin.with_vertices(|vertex| SkinVertex {
        position: vertex.position * size,
        height: vertex.height * (size * thickness),
        ..*vertex
    })
}

/// A point at which a line meets the boundary of a shell, in double precision.
#[derive(Debug, Clone, Copy)]
pub(super) struct Crossing {
    pub t: f64,
    /// Triangle of the boundary.
    pub boundary: usize,
    /// Cosine between the line and the triangle's normal; negative where the line enters.
    pub cosine: f64,
}

/// Returns the boundary's triangles.
pub(super) fn triangles(shell: &Shell) -> Vec<[DVec3; 3]> {
    (0..shell.boundary().len()).map(|i| shell.boundary_triangle(i).map(|p| p.as_dvec3())).collect()
}

/// Returns all crossings of a line and triangles in the order of t [Möller 1997].
pub(super) fn crossings(triangles: &[[DVec3; 3]], origin: Vec3, direction: Vec3) -> Vec<Crossing> {
    let (o, d) = (origin.as_dvec3(), direction.as_dvec3());
    let meets = |(boundary, [a, b, c]): (usize, &[DVec3; 3])| {
        let (e, f) = (b - a, c - a);
        let p = d.cross(f);
        let determinant = e.dot(p);
        let s = o - a;
        let u = s.dot(p) / determinant;
        if !(0.0..=1.0).contains(&u) {
            return None;
        }
        let q = s.cross(e);
        let v = d.dot(q) / determinant;
        let cosine = -determinant / (e.cross(f).length() * d.length());
        (v >= 0.0 && u + v <= 1.0).then(|| Crossing { t: f.dot(q) / determinant, boundary, cosine })
    };
    let mut found: Vec<Crossing> = triangles.iter().enumerate().filter_map(meets).collect();
    found.sort_by(|a, b| a.t.total_cmp(&b.t));
    found
}

/// Returns all intervals of a line: each entry that is not behind the last exit is walked, from there on.
pub(super) fn intervals(shell: &Shell, origin: Vec3, direction: Vec3, found: &[Crossing]) -> Vec<Interval> {
    let slack = 1e-5 * (origin.length() / direction.length() + 1.0);
    let mut t = f32::MIN;
    let mut all = Vec::new();
    for entry in found.iter().filter(|crossing| crossing.cosine < 0.0) {
        if entry.t as f32 >= t - slack {
            let mut walk = shell.enter(origin, direction, shell.boundary()[entry.boundary], t, f32::MAX);
            all.extend(&mut walk);
            t = walk.t();
        }
    }
    all
}

/// Returns a vector within a cube about the origin.
pub(super) fn vector(random: &mut Random, range: f32) -> Vec3 {
    Vec3::from([(); 3].map(|()| random.within(-range, range)))
}
