//! Texels that are larger than pixels: the nearest, one of the four around, or all four by their weights.

use crate::support::{backends, count_differences};
use btf_viewer::{
    BackendChoice, Camera, Control, Filter, MeshChoice, RenderParams, Rendered, Scene, SceneAsset, ShadeOptions, render,
};
use glam::Vec3;
use std::sync::Arc;

/// Draws a few texels of the built-in cloth.
fn draw(filter: Filter, frames: u32, backend: BackendChoice) -> Rendered {
    let mut scene = Scene::built_in(&MeshChoice::Plane, vec![Arc::new(SceneAsset::built_in())], [1.0; 2]).unwrap();
    // 64 texels on a plane 2 wide, of which the picture shows 5.
    scene.camera = Camera { eye: Vec3::Z * 0.3, target: Vec3::ZERO, up: Vec3::Y, fov_deg: 30.0 };
    let shade = ShadeOptions { filter, ..ShadeOptions::default() };
    render(
        &scene,
        &RenderParams { size: [32, 32], frames, backend, shade, ..RenderParams::default() },
        &Control::SILENT,
    )
    .unwrap()
}

/// Returns the root mean square of the difference of two pictures over the mean of the first.
fn difference(a: &Rendered, b: &Rendered) -> f32 {
    let [a, b] = [a, b].map(|rendered| rendered.picture.radiance.as_flattened());
    let squares: f32 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / a.len() as f32).sqrt() / (a.iter().sum::<f32>() / a.len() as f32)
}

#[test]
fn the_mean_of_drawn_texels_is_their_linear_interpolation() {
    let linear = draw(Filter::Linear, 64, BackendChoice::Cpu);
    let [few, many] =
        [64, 1024].map(|frames| difference(&linear, &draw(Filter::Stochastic, frames, BackendChoice::Cpu)));
    let nearest = difference(&linear, &draw(Filter::Nearest, 64, BackendChoice::Cpu));
    println!("64 draws {few:.4}, 1024 draws {many:.4}, nearest {nearest:.4}");
    assert!(many < 0.5 * few && many < 0.01, "{many} {few}");
    // Planted difference: the nearest texel.
    assert!(nearest > 10.0 * many, "{nearest} {many}");
}

#[test]
fn linear_pictures_are_those_of_the_cpu() {
    let cpu = draw(Filter::Linear, 2, BackendChoice::Cpu);
    for backend in backends("linear_pictures_are_those_of_the_cpu") {
        let found = draw(Filter::Linear, 2, backend);
        let differences = count_differences(&cpu.picture.radiance, &found.picture.radiance);
        assert!(differences <= cpu.hits.len() / 200, "{backend:?}: {differences}");
        assert_eq!(found.report.spmm_evaluations, cpu.report.spmm_evaluations, "{backend:?}");
        // Planted difference: one texel of the four.
        let other = draw(Filter::Stochastic, 2, backend).picture.radiance;
        assert!(count_differences(&cpu.picture.radiance, &other) > cpu.hits.len() / 2);
    }
}
