//! The limits that are asked of an adapter.

/// Storage buffers that are asked for where the adapter has as many; 8 are in every one.
const MAX_STORAGE_BUFFERS: u32 = 40;
/// Whether the program runs in a browser.
pub(crate) const IN_BROWSER: bool = cfg!(target_arch = "wasm32");

/// Returns the limits to ask of an adapter that `has` these: large buffers where it has them. In a browser those that all
/// implementations of WebGPU have [WebGPU, section 3.6.2], so that a page runs wherever there is one: 8 storage
/// buffers a stage, 128 MiB a binding.
pub(crate) fn asked_limits(has: &wgpu::Limits) -> wgpu::Limits {
    if IN_BROWSER {
        return wgpu::Limits::default();
    }
    wgpu::Limits {
        max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
        max_buffer_size: has.max_buffer_size,
        max_storage_buffers_per_shader_stage: has.max_storage_buffers_per_shader_stage.min(MAX_STORAGE_BUFFERS),
        max_texture_dimension_2d: has.max_texture_dimension_2d,
        ..wgpu::Limits::default()
    }
}

/// Returns, for the user, what an adapter that `has` these limits is missing of those that are `asked`.
pub(crate) fn missing_limit(asked: &wgpu::Limits, has: &wgpu::Limits) -> Option<String> {
    let pairs = told(asked).into_iter().zip(told(has));
    let missing = pairs.into_iter().find(|((_, asked), (_, has))| has < asked);
    missing
        .map(|((what, asked), (_, has))| format!("it has {has} {what} and {asked} are needed; choose another adapter"))
}

/// Returns the limits that the shaders come near to.
fn told(limits: &wgpu::Limits) -> [(&'static str, u64); 6] {
    [
        ("bytes a buffer", limits.max_buffer_size),
        ("bytes a binding", limits.max_storage_buffer_binding_size),
        ("storage buffers a stage", limits.max_storage_buffers_per_shader_stage.into()),
        ("pixels on a texture's side", limits.max_texture_dimension_2d.into()),
        ("threads a workgroup", limits.max_compute_invocations_per_workgroup.into()),
        ("workgroups a dimension", limits.max_compute_workgroups_per_dimension.into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_adapter_below_the_defaults_is_refused_with_what_it_is_missing() {
        let has = wgpu::Limits::default();
        assert_eq!(missing_limit(&asked_limits(&has), &has), None);
        let few = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..wgpu::Limits::default() };
        let told = missing_limit(&wgpu::Limits::default(), &few).unwrap();
        assert!(told.starts_with("it has 4 storage buffers a stage and 8 are needed"), "{told}");
    }

    #[test]
    fn large_buffers_are_asked_for_where_they_are_and_few_storage_buffers_are_not_many() {
        let has = wgpu::Limits {
            max_storage_buffers_per_shader_stage: 1000,
            max_storage_buffer_binding_size: 1 << 30,
            ..wgpu::Limits::default()
        };
        let asked = asked_limits(&has);
        assert_eq!(asked.max_storage_buffers_per_shader_stage, MAX_STORAGE_BUFFERS);
        assert_eq!(asked.max_storage_buffer_binding_size, 1 << 30);
    }
}
