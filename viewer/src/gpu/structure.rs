//! What rays are traced against: vertices, triangles and instances, with a hierarchy in storage buffers or an
//! acceleration structure over them.

use crate::error::ViewerError;
use crate::geometry::bvh_node::BvhNode;
use crate::geometry::geometry::Geometry;
use crate::gpu::acceleration_structure::acceleration_structure;
use crate::gpu::backend::GpuTracer;
use crate::gpu::device::Gpu;
use crate::gpu::layout::{bind, structure_layout};
use crate::gpu::modules::ModuleLayout;
use crate::gpu::pieces::{NODES, PieceLayout, Pieces, TRIANGLES, VERTICES};
use crate::scene::scene::Scene;
use std::borrow::Cow;
use wgpu::BufferUsages;

/// The arrays of a scene's geometry, and behind it of its volumes' proxies.
struct Arrays {
    vertices: Pieces,
    triangles: Pieces,
    /// The hierarchies of [`GpuTracer::Bvh`].
    nodes: Option<Pieces>,
    instances: wgpu::Buffer,
}

/// Bind group 1 of a tracer.
pub(crate) struct Structure {
    gpu: Gpu,
    arrays: Arrays,
    /// Node where the hierarchy over the volumes' proxies begins.
    pub volume_root: u32,
    /// How the module's arrays are cut, those of the assets among them.
    pub cut: ModuleLayout,
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
    // Kept alive for the bind group.
    _blas: Vec<wgpu::Blas>,
}

impl Structure {
    /// Uploads the geometry of `scene`. `assets` says how the words of the scene are cut.
    ///
    /// # Errors
    /// [`ViewerError::Gpu`] where the adapter binds fewer pieces, or takes fewer triangles or instances.
    pub(crate) fn new(
        gpu: &Gpu,
        scene: &Scene,
        tracer: GpuTracer,
        assets: PieceLayout,
    ) -> Result<Structure, ViewerError> {
        let (geometry, volume_root) = with_proxies(scene);
        let geometry = &*geometry;
        let arrays = Arrays::new(gpu, geometry, tracer)?;
        let cut = ModuleLayout {
            assets,
            vertices: arrays.vertices.layout,
            triangles: arrays.triangles.layout,
            nodes: arrays.nodes.as_ref().map_or(PieceLayout::WHOLE, |nodes| nodes.layout),
            ..ModuleLayout::of_scene(scene, tracer, geometry, &[geometry.root(), volume_root])
        };
        check_pieces(gpu, &cut)?;
        let layout = structure_layout(gpu, tracer, cut);
        let (group, _blas) = arrays.bind(gpu, scene, geometry, &layout)?;
        Ok(Structure { gpu: gpu.clone(), arrays, volume_root, cut, layout, group, _blas })
    }

    /// Writes the factors of the scene's instances and where they stand.
    pub(crate) fn write_instances(&self, scene: &Scene) {
        let instances = bytemuck::cast_slice(scene.geometry.instances());
        self.gpu.queue.write_buffer(&self.arrays.instances, 0, instances);
    }

    /// Writes where instances and proxies have moved. Cost: with ray queries, a new acceleration structure.
    ///
    /// # Errors
    /// As [`Structure::new`].
    pub(crate) fn move_proxies(&mut self, scene: &Scene) -> Result<(), ViewerError> {
        let Some(volumes) = &scene.volumes else { return Ok(()) };
        self.write_instances(scene);
        self.arrays.vertices.write(scene.geometry.vertices().len(), volumes.proxies().vertices());
        if let Some(nodes) = &self.arrays.nodes {
            let root = scene.geometry.root() as usize;
            let over_instances = scene.geometry.nodes()[root..].iter().copied();
            let moved: Vec<BvhNode> = over_instances.chain(scene.geometry.nodes_behind(volumes.proxies())).collect();
            nodes.write(root, &moved);
            return Ok(());
        }
        let (geometry, _) = scene.geometry.followed_by(volumes.proxies());
        (self.group, self._blas) = self.arrays.bind(&self.gpu, scene, &geometry, &self.layout)?;
        Ok(())
    }
}

impl Arrays {
    fn new(gpu: &Gpu, geometry: &Geometry, tracer: GpuTracer) -> Result<Arrays, ViewerError> {
        let input = if tracer == GpuTracer::RayQuery { BufferUsages::BLAS_INPUT } else { BufferUsages::empty() };
        Ok(Arrays {
            vertices: Pieces::new(gpu, "vertices", geometry.vertices(), input)?,
            triangles: Pieces::new(gpu, "triangles", geometry.triangles(), BufferUsages::empty())?,
            nodes: match tracer {
                GpuTracer::Bvh => Some(Pieces::new(gpu, "nodes", geometry.nodes(), BufferUsages::empty())?),
                GpuTracer::RayQuery => None,
            },
            instances: gpu.buffer("instances", bytemuck::cast_slice(geometry.instances()), BufferUsages::STORAGE)?,
        })
    }

    /// Returns the bind group of the arrays, and with ray queries the acceleration structure over them. `geometry` has
    /// the volumes' proxies behind what the scene has.
    fn bind(
        &self,
        gpu: &Gpu,
        scene: &Scene,
        geometry: &Geometry,
        layout: &wgpu::BindGroupLayout,
    ) -> Result<(wgpu::BindGroup, Vec<wgpu::Blas>), ViewerError> {
        let mut resources = vec![(1, self.instances.as_entire_binding())];
        resources.extend(self.vertices.entries(&VERTICES));
        resources.extend(self.triangles.entries(&TRIANGLES));
        if let Some(nodes) = &self.nodes {
            resources.extend(nodes.entries(&NODES));
            return Ok((bind(gpu, layout, &resources), Vec::new()));
        }
        // The structure is built from one buffer; where the shaders' lie in pieces it gets its own.
        let own = match self.vertices.buffers.as_slice() {
            [_] => None,
            _ => Some(gpu.buffer("vertices", bytemuck::cast_slice(geometry.vertices()), BufferUsages::BLAS_INPUT)?),
        };
        let vertices = own.as_ref().unwrap_or(&self.vertices.buffers[0]);
        let (tlas, blas) = acceleration_structure(gpu, geometry, scene, vertices)?;
        resources.push((0, tlas.as_binding()));
        Ok((bind(gpu, layout, &resources), blas))
    }
}

/// Returns the geometry that rays meet, with the proxies of the scene's volumes, and the node where the hierarchy over those begins;
/// the scene's root where there are none.
pub(crate) fn with_proxies(scene: &Scene) -> (Cow<'_, Geometry>, u32) {
    match &scene.volumes {
        Some(volumes) => {
            let (geometry, root) = scene.geometry.followed_by(volumes.proxies());
            (Cow::Owned(geometry), root)
        }
        None => (Cow::Borrowed(&*scene.geometry), scene.geometry.root()),
    }
}

/// Checks that the adapter binds all pieces at once.
fn check_pieces(gpu: &Gpu, cut: &ModuleLayout) -> Result<(), ViewerError> {
    let pieces: u32 = [cut.assets, cut.vertices, cut.triangles, cut.nodes].iter().map(|layout| layout.pieces).sum();
    if pieces <= gpu.max_pieces() {
        return Ok(());
    }
    Err(gpu.error(format!(
        "assets and mesh take {pieces} pieces of what this adapter binds at once, and it binds {}; simplify the mesh, or \
         fit smaller assets (btf-fit fit --bytes)",
        gpu.max_pieces()
    )))
}
