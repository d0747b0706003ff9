// Light from all around. Twin: environment.rs, which says how directions lie in the picture.

const ENVIRONMENT_PI: f32 = 3.14159265;
const ENVIRONMENT_TAU: f32 = 6.2831853;

// Reads a number of the table: distribution of the rows, of the columns of each row, radiance.
fn environment_number(index: u32) -> f32 {
    return asset_f32(frame.environment_at + index);
}

// Reads the radiance of a pixel.
fn environment_pixel(row: u32, column: u32) -> vec3<f32> {
    let size = frame.environment;
    let at = size.y + 1u + size.y * (size.x + 1u) + (row * size.x + column) * 3u;
    return vec3<f32>(environment_number(at), environment_number(at + 1u), environment_number(at + 2u));
}

// Returns the radiance from a unit direction, bilinear.
fn environment_radiance(d: vec3<f32>) -> vec3<f32> {
    let size = frame.environment;
    let at = environment_place(d);
    let x = at.x * f32(size.x) - 0.5;
    let y = clamp(at.y * f32(size.y) - 0.5, 0.0, f32(size.y) - 1.0);
    let left = u32(i32(floor(x)) + i32(size.x)) % size.x;
    let upper = u32(y);
    let right = (left + 1u) % size.x;
    let lower = min(upper + 1u, size.y - 1u);
    let along = x - floor(x);
    let top = mix(environment_pixel(upper, left), environment_pixel(upper, right), along);
    let bottom = mix(environment_pixel(lower, left), environment_pixel(lower, right), along);
    return mix(top, bottom, y - f32(upper));
}

// Rows, poles included, and columns of the table of irradiance by normal. Twin: sky_irradiance.rs.
const IRRADIANCE_ROWS: u32 = 17u;
const IRRADIANCE_COLUMNS: u32 = 32u;

// Reads an entry of the table of irradiance by normal.
fn irradiance_entry(row: u32, column: u32) -> vec3<f32> {
    let size = frame.environment;
    let pixels_at = size.y + 1u + size.y * (size.x + 1u);
    let at = pixels_at + (size.x * size.y + row * IRRADIANCE_COLUMNS + column) * 3u;
    return vec3<f32>(environment_number(at), environment_number(at + 1u), environment_number(at + 2u));
}

// Returns the irradiance of a unit normal, without shadows.
fn environment_irradiance(normal: vec3<f32>) -> vec3<f32> {
    let place = environment_place(normal);
    // Its columns begin at -z.
    let x = fract(place.x + 0.5) * f32(IRRADIANCE_COLUMNS);
    let y = place.y * f32(IRRADIANCE_ROWS - 1u);
    let left = u32(x) % IRRADIANCE_COLUMNS;
    let upper = min(u32(y), IRRADIANCE_ROWS - 2u);
    let right = (left + 1u) % IRRADIANCE_COLUMNS;
    let along = x - floor(x);
    let top = mix(irradiance_entry(upper, left), irradiance_entry(upper, right), along);
    let bottom = mix(irradiance_entry(upper + 1u, left), irradiance_entry(upper + 1u, right), along);
    return mix(top, bottom, y - f32(upper));
}

// Draws a direction from two numbers in [0, 1).
fn environment_sample(at: vec2<f32>) -> vec3<f32> {
    let size = frame.environment;
    let row = environment_find(0u, size.y, at.y);
    let column = environment_find(size.y + 1u + u32(row.x) * (size.x + 1u), size.x, at.x);
    let azimuth = ENVIRONMENT_TAU * ((column.x + column.y) / f32(size.x) - 0.5);
    let polar = ENVIRONMENT_PI * (row.x + row.y) / f32(size.y);
    return vec3<f32>(sin(polar) * sin(azimuth), cos(polar), -sin(polar) * cos(azimuth));
}

// Returns the density of environment_sample, per steradian.
fn environment_density(d: vec3<f32>) -> f32 {
    let size = frame.environment;
    let at = environment_place(d);
    let row = min(u32(at.y * f32(size.y)), size.y - 1u);
    let column = min(u32(at.x * f32(size.x)), size.x - 1u);
    let of_row = size.y + 1u + row * (size.x + 1u) + column;
    let share = (environment_number(row + 1u) - environment_number(row)) * (environment_number(of_row + 1u) - environment_number(of_row));
    return share * f32(size.x * size.y) / (2.0 * ENVIRONMENT_PI * ENVIRONMENT_PI * sqrt(max(1.0 - d.y * d.y, 1e-8)));
}

// Returns the step of the distribution at `first` with `count` steps in which `x` lies, and where in it.
fn environment_find(first: u32, count: u32, x: f32) -> vec2<f32> {
    var low = 0u;
    var high = count;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if environment_number(first + middle) <= x {
            low = middle;
        } else {
            high = middle;
        }
    }
    let range = vec2<f32>(environment_number(first + low), environment_number(first + low + 1u));
    if range.y > range.x {
        return vec2<f32>(f32(low), clamp((x - range.x) / (range.y - range.x), 0.0, 1.0));
    }
    return vec2<f32>(f32(low), 0.5);
}

// Returns where in the picture a unit direction lies, 0 to 1 to the right and downwards.
fn environment_place(d: vec3<f32>) -> vec2<f32> {
    // The zenith has no azimuth; WGSL's atan2 has no value there.
    let azimuth = select(atan2(d.x, -d.z), 0.0, abs(d.x) + abs(d.z) < 1e-12);
    return vec2<f32>(0.5 + azimuth / ENVIRONMENT_TAU, acos(clamp(d.y, -1.0, 1.0)) / ENVIRONMENT_PI);
}
