//! Gives the shared library its name, so that programs look for it by that and not by the path at which they were linked.

fn main() {
    let target = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    match target.as_str() {
        "linux" => println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libbtf.so"),
        "macos" => println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libbtf.dylib"),
        _ => {}
    }
}
