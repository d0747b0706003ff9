// A BTF from the textures of `btf-fit export-ktx2 --bc`. Formats and meaning: docs/reference/ktx2-filtered.md
// Before it: #version 450. Bind the sampler with linear filters and mips, repeated or clamped like the texture it is for.
layout(set = 0, binding = 0) uniform texture2D btf_tables;      // NAME.ktx2
layout(set = 0, binding = 1) uniform texture2DArray btf_planes; // NAME.planes-front.ktx2
layout(set = 0, binding = 2) uniform texture2DArray btf_fine;   // NAME.fine-front.ktx2
layout(set = 0, binding = 3) uniform texture2DArray btf_bases;  // NAME.bases-front.ktx2
layout(set = 0, binding = 4) uniform texture2D btf_mean;        // NAME.mean-front.ktx2
layout(set = 0, binding = 5) uniform sampler btf_sampler;

vec4 btf_table(int i) { return texelFetch(sampler2D(btf_tables, btf_sampler), ivec2(i % 64, i / 64), 0); }

// Place of a light in the square of a view's tile, 0 to 1: an equal-area disk, drawn out to a square.
vec2 btf_square(vec3 d, float radius) {
    vec2 p = d.xy / (radius * sqrt(1.0 + d.z));
    vec2 a = abs(p);
    float r = min(length(p), 1.0);
    float turned = r * atan(min(a.x, a.y), max(a.x, 1e-9 + a.y)) * 1.2732395;
    vec2 q = a.x >= a.y ? vec2(r, turned) : vec2(turned, r);
    return 0.5 + 0.5 * vec2(p.x < 0.0 ? -q.x : q.x, p.y < 0.0 ? -q.y : q.y);
}

// Reflectance times cosine, linear RGB. uv: 0, 0 is the corner of the first texel. lod: mip level, as textureQueryLod has
// it. wi, wo: unit vectors to light and eye; x along u, y against v, z along the normal.
vec3 btf(vec2 uv, float lod, vec3 wi, vec3 wo) {
    if (wi.z <= 0.0 || wo.z <= 0.0) return vec3(0.0);
    vec4 head = btf_table(0);  // nodes a side, tiles in a row, pairs of planes with mips, pairs of planes
    vec4 reach = btf_table(1); // disk radius, cosine of the lowest light, cosine from where on it fades, views
    // The triangle of measured views around the eye.
    ivec2 cell = ivec2(clamp(wo.xy * 32.0 + 32.0, 0.0, 63.0));
    vec3 ids = btf_table(64 + cell.y * 64 + cell.x).xyz;
    vec2 a = btf_table(4160 + int(ids.x)).xy;
    vec2 e = btf_table(4160 + int(ids.y)).xy - a, f = btf_table(4160 + int(ids.z)).xy - a, p = wo.xy - a;
    float area = e.x * f.y - e.y * f.x; // 0 where all views are on a line
    vec2 w = vec2(p.x * f.y - p.y * f.x, e.x * p.y - e.y * p.x) / area;
    if (abs(area) < 1e-9) w = vec2(clamp(dot(p, e) / max(dot(e, e), 1e-9), 0.0, 1.0), 0.0);
    vec3 weight = max(vec3(1.0 - w.x - w.y, w), 0.0);
    weight /= weight.x + weight.y + weight.z;
    // The light's place in the tiles of these views.
    vec2 node = btf_square(wi, reach.x) * (head.x - 1.0) + 0.5, size = vec2(textureSize(sampler2D(btf_mean, btf_sampler), 0));
    vec2 place[3];
    vec3 sum = vec3(0.0);
    for (int v = 0; v < 3; v++) {
        float row = floor((ids[v] + 0.5) / head.y);
        place[v] = (vec2(ids[v] - row * head.y, row) * head.x + node) / size;
        sum += weight[v] * textureLod(sampler2D(btf_mean, btf_sampler), place[v], 0.0).rgb;
    }
    // Coarse levels do without the weak components.
    float share = clamp(1.0 - lod, 0.0, 1.0);
    int pairs = int(share > 0.0 ? head.w : head.z), scales = 4160 + int(reach.w), coarse = int(head.z);
    for (int i = 0; i < pairs; i++) {
        vec2 c = (i < coarse ? textureLod(sampler2DArray(btf_planes, btf_sampler), vec3(uv, i), lod).rg
                             : textureLod(sampler2DArray(btf_fine, btf_sampler), vec3(uv, i - coarse), 0.0).rg);
        c = (c - 128.0 / 255.0) * btf_table(scales + i).xy * (i < coarse ? 1.0 : share);
        for (int v = 0; v < 3; v++)
            sum += weight[v] * (c.x * (textureLod(sampler2DArray(btf_bases, btf_sampler), vec3(place[v], 2 * i), 0.0).rgb - 128.0 / 255.0)
                              + c.y * (textureLod(sampler2DArray(btf_bases, btf_sampler), vec3(place[v], 2 * i + 1), 0.0).rgb - 128.0 / 255.0));
    }
    return pow(max(sum, 0.0), vec3(2.4)) * min(wi.z / reach.y, 1.0) * min(wi.z / reach.z, 1.0);
}
