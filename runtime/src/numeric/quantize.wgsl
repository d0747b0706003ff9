// Number encodings. Twin: numeric/quantize.rs. The includer defines `fn asset_word(index: u32) -> u32`.

fn asset_f32(index: u32) -> f32 {
    return bitcast<f32>(asset_word(index));
}

fn weight_from_byte(q: u32, scale: f32) -> f32 {
    let x = f32(q) / 255.0;
    return scale * x * x;
}

fn coefficient_from_byte(byte: u32) -> f32 {
    return f32(bitcast<i32>(byte << 24u) >> 24u);
}
