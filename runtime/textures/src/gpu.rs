//! The textures on a device of wgpu.

use crate::files::{Texture, Textures};
use wgpu::{BindingResource, ShaderStages, TextureSampleType, TextureViewDimension};

/// Features that a device needs.
pub const FEATURES: wgpu::Features = wgpu::Features::TEXTURE_COMPRESSION_BC;

/// Returns the limits that a device needs: those of WebGPU, which has 256 array layers by default.
pub fn limits() -> wgpu::Limits {
    wgpu::Limits::default()
}

/// Textures and sampler, to be bound as group 0 of a shader with the decoder in it.
pub struct Uploaded {
    /// Layout of the group.
    pub layout: wgpu::BindGroupLayout,
    /// The group.
    pub group: wgpu::BindGroup,
}

/// Uploads the textures of a layer, for the `stages` that evaluate them. The sampler repeats the material.
pub fn upload(textures: &Textures, device: &wgpu::Device, queue: &wgpu::Queue, stages: ShaderStages) -> Uploaded {
    let views: Vec<wgpu::TextureView> = textures.all.iter().map(|texture| view(texture, device, queue)).collect();
    let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
        label: Some("material"),
        address_mode_u: wgpu::AddressMode::Repeat,
        address_mode_v: wgpu::AddressMode::Repeat,
        mag_filter: wgpu::FilterMode::Linear,
        min_filter: wgpu::FilterMode::Linear,
        mipmap_filter: wgpu::MipmapFilterMode::Linear,
        ..Default::default()
    });
    let entry = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility: stages, ty, count: None };
    let mut entries: Vec<_> = (0..)
        .zip(&textures.all)
        .map(|(binding, texture)| {
            // Singles are read texel by texel.
            let filterable = texture.format != wgpu::TextureFormat::Rgba32Float;
            let view_dimension = dimension(texture);
            let sample_type = TextureSampleType::Float { filterable };
            entry(binding, wgpu::BindingType::Texture { sample_type, view_dimension, multisampled: false })
        })
        .collect();
    let last = textures.all.len() as u32;
    entries.push(entry(last, wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)));
    let layout = device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("material"), entries: &entries });
    let mut bound: Vec<_> = (0..)
        .zip(&views)
        .map(|(binding, view)| wgpu::BindGroupEntry { binding, resource: BindingResource::TextureView(view) })
        .collect();
    bound.push(wgpu::BindGroupEntry { binding: last, resource: BindingResource::Sampler(&sampler) });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("material"),
        layout: &layout,
        entries: &bound,
    });
    Uploaded { layout, group }
}

fn dimension(texture: &Texture) -> TextureViewDimension {
    if texture.layers.is_some() { TextureViewDimension::D2Array } else { TextureViewDimension::D2 }
}

fn view(texture: &Texture, device: &wgpu::Device, queue: &wgpu::Queue) -> wgpu::TextureView {
    let made = device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: texture.size[0],
            height: texture.size[1],
            depth_or_array_layers: texture.layers.unwrap_or(1),
        },
        mip_level_count: texture.levels.len() as u32,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: texture.format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let (side, block_bytes) = (texture.format.block_dimensions().0, texture.format.block_copy_size(None).unwrap_or(1));
    for (level, bytes) in (0..).zip(&texture.levels) {
        // Blocks at the edge are copied in whole.
        let [width, height] = texture.size.map(|texels| (texels >> level).max(1).next_multiple_of(side));
        queue.write_texture(
            wgpu::TexelCopyTextureInfo { mip_level: level, ..made.as_image_copy() },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(width / side * block_bytes),
                rows_per_image: Some(height / side),
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: texture.layers.unwrap_or(1) },
        );
    }
    made.create_view(&wgpu::TextureViewDescriptor { dimension: Some(dimension(texture)), ..Default::default() })
}
