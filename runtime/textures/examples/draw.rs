//! Draws a ball and a ground with the block-compressed textures of an asset, with wgpu and nothing of ours but the
//! decoder's text:
//!
//! ```text
//! btf-fit export-ktx2 wool.spmm -o wool.ktx2 --bc
//! cargo run --release -p btf-textures --example draw -- wool.ktx2 wool.png
//! ```

use btf_textures::{FEATURES, GLSL, limits, read_textures, upload};
use std::error::Error;
use std::path::Path;
use wgpu::util::DeviceExt;

const WIDTH: u32 = 960;
const HEIGHT: u32 = 540;
/// Repeats of the material around half the ball.
const REPEATS: f32 = 4.0;
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// A triangle over the whole picture.
const VERTEX: &str = "#version 450
void main() { gl_Position = vec4(gl_VertexIndex == 1 ? 3.0 : -1.0, gl_VertexIndex == 2 ? 3.0 : -1.0, 0.0, 1.0); }";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, file, picture] = &arguments[..] else {
        return Err("usage: draw FILE.ktx2 PICTURE.png".into());
    };
    let textures = read_textures(Path::new(file), "front")?;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: FEATURES,
        required_limits: limits(),
        ..Default::default()
    }))?;
    let material = upload(&textures, &device, &queue, wgpu::ShaderStages::FRAGMENT);
    let pixels = draw(&device, &queue, &material);
    image::save_buffer(picture, &pixels, WIDTH, HEIGHT, image::ColorType::Rgba8)?;
    println!("{picture}: drawn on {}", adapter.get_info().name);
    Ok(())
}

fn draw(device: &wgpu::Device, queue: &wgpu::Queue, material: &btf_textures::Uploaded) -> Vec<u8> {
    let scene = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("scene"),
        contents: bytemuck::bytes_of(&[WIDTH as f32, HEIGHT as f32, REPEATS, 0.0]),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let pipeline = pipeline(device, material);
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("scene"),
        layout: &pipeline.get_bind_group_layout(1),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: scene.as_entire_binding() }],
    });
    let target = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("picture"),
        size: wgpu::Extent3d { width: WIDTH, height: HEIGHT, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &material.group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.draw(0..3, 0..1);
    }
    read_back(device, queue, encoder, &target)
}

fn pipeline(device: &wgpu::Device, material: &btf_textures::Uploaded) -> wgpu::RenderPipeline {
    let fragment = format!("#version 450\n{GLSL}\n{}", include_str!("draw.frag"));
    let module = |label, text: String, stage| {
        let source = wgpu::ShaderSource::Glsl { shader: text.into(), stage, defines: &[] };
        device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(label), source })
    };
    let vertex = module("triangle", VERTEX.into(), wgpu::naga::ShaderStage::Vertex);
    let fragment = module("material", fragment, wgpu::naga::ShaderStage::Fragment);
    let scene_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: Some("scene"),
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &[Some(&material.layout), Some(&scene_layout)],
        immediate_size: 0,
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("draw"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &vertex,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &fragment,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Copies the picture to memory, RGBA, row by row.
fn read_back(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    mut encoder: wgpu::CommandEncoder,
    target: &wgpu::Texture,
) -> Vec<u8> {
    let row = (4 * WIDTH).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("pixels"),
        size: u64::from(row * HEIGHT),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &buffer,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        target.size(),
    );
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.expect("the picture can be mapped"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device answers");
    let rows = buffer.get_mapped_range(..).expect("the picture is mapped").to_vec();
    rows.chunks_exact(row as usize).flat_map(|pixels| pixels[..4 * WIDTH as usize].to_vec()).collect()
}
