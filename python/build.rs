//! Passes the linker arguments that macOS needs for a module whose Python symbols are resolved at load.

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
