// A map of heights, interpolated between texels. Twin: asset/height_field.rs.

// A layer's displacement map; the range is that of its heights, texel widths.
struct HeightField {
    at: u32,
    size: vec2<u32>,
    step: f32,
    range: vec2<f32>,
}

fn height_of_texel(field: HeightField, at: vec2<u32>) -> f32 {
    let texel = at.y * field.size.x + at.x;
    return field.step * coefficient_from_byte((asset_word(field.at + texel / 4u) >> (8u * (texel % 4u))) & 0xffu);
}

// Interpolates bilinearly between two columns and two rows, `part` of the way from the first to the next.
fn height_between(field: HeightField, first: vec2<u32>, next: vec2<u32>, part: vec2<f32>) -> f32 {
    let upper_left = height_of_texel(field, first);
    let lower_left = height_of_texel(field, vec2<u32>(first.x, next.y));
    let upper = upper_left + (height_of_texel(field, vec2<u32>(next.x, first.y)) - upper_left) * part.x;
    let lower = lower_left + (height_of_texel(field, next) - lower_left) * part.x;
    return upper + (lower - upper) * part.y;
}

// Interpolates bilinearly; the edges continue outside. Texel centres are at whole numbers.
fn height_at(field: HeightField, given: vec2<f32>) -> f32 {
    let most = field.size - vec2<u32>(1u);
    let place = clamp(given, vec2<f32>(0.0), vec2<f32>(most));
    let first = vec2<u32>(place);
    let next = min(first + vec2<u32>(1u), most);
    let part = place - vec2<f32>(first);
    return height_between(field, first, next, part);
}

// Interpolates bilinearly; the map repeats. Texel centres are at whole numbers.
fn height_at_wrapped(field: HeightField, place: vec2<f32>) -> f32 {
    let size = vec2<f32>(field.size);
    let whole = floor(place);
    let first = min(vec2<u32>(whole - size * floor(whole / size)), field.size - vec2<u32>(1u));
    let next = (first + vec2<u32>(1u)) % field.size;
    let part = place - whole;
    return height_between(field, first, next, part);
}
