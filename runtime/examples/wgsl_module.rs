//! Prints the WGSL of the decoders as a script of JavaScript: `cargo xtask web` puts it into the package for browsers.

fn main() {
    let text = |wgsl: String| wgsl.replace('\\', "\\\\").replace('`', "\\`").replace("${", "\\${");
    println!("// The decoder of assets in WGSL; wgsl.d.ts tells how it is used.");
    println!("export const btfWGSL = `{}`;", text(btf_runtime::wgsl_library()));
}
