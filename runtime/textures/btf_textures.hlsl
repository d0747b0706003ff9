// A BTF from the textures of `btf-fit export-ktx2 --bc`. Formats and meaning: docs/reference/ktx2-filtered.md
// Bind the sampler with linear filters and mips, repeated or clamped like the texture it is for.
Texture2D<float4> btf_tables : register(t0);      // NAME.ktx2
Texture2DArray<float4> btf_planes : register(t1); // NAME.planes-front.ktx2
Texture2DArray<float4> btf_fine : register(t2);   // NAME.fine-front.ktx2
Texture2DArray<float4> btf_bases : register(t3);  // NAME.bases-front.ktx2
Texture2D<float4> btf_mean : register(t4);        // NAME.mean-front.ktx2
SamplerState btf_sampler : register(s5);

float4 btf_table(int i) { return btf_tables.Load(int3(i % 64, i / 64, 0)); }

// Place of a light in the square of a view's tile, 0 to 1: an equal-area disk, drawn out to a square.
float2 btf_square(float3 d, float radius) {
    float2 p = d.xy / (radius * sqrt(1.0 + d.z));
    float2 a = abs(p);
    float r = min(length(p), 1.0);
    float turned = r * atan2(min(a.x, a.y), max(a.x, 1e-9 + a.y)) * 1.2732395;
    float2 q = a.x >= a.y ? float2(r, turned) : float2(turned, r);
    return 0.5 + 0.5 * float2(p.x < 0.0 ? -q.x : q.x, p.y < 0.0 ? -q.y : q.y);
}

// Reflectance times cosine, linear RGB. uv: 0, 0 is the corner of the first texel. lod: mip level, as CalculateLevelOfDetail
// has it. wi, wo: unit vectors to light and eye; x along u, y against v, z along the normal.
float3 btf(float2 uv, float lod, float3 wi, float3 wo) {
    if (wi.z <= 0.0 || wo.z <= 0.0) return 0.0;
    float4 head = btf_table(0);  // nodes a side, tiles in a row, pairs of planes with mips, pairs of planes
    float4 reach = btf_table(1); // disk radius, cosine of the lowest light, cosine from where on it fades, views
    // The triangle of measured views around the eye.
    int2 cell = int2(clamp(wo.xy * 32.0 + 32.0, 0.0, 63.0));
    float3 ids = btf_table(64 + cell.y * 64 + cell.x).xyz;
    float2 a = btf_table(4160 + int(ids.x)).xy;
    float2 e = btf_table(4160 + int(ids.y)).xy - a, f = btf_table(4160 + int(ids.z)).xy - a, p = wo.xy - a;
    float area = e.x * f.y - e.y * f.x; // 0 where all views are on a line
    float2 w = float2(p.x * f.y - p.y * f.x, e.x * p.y - e.y * p.x) / area;
    if (abs(area) < 1e-9) w = float2(clamp(dot(p, e) / max(dot(e, e), 1e-9), 0.0, 1.0), 0.0);
    float3 weight = max(float3(1.0 - w.x - w.y, w), 0.0);
    weight /= weight.x + weight.y + weight.z;
    // The light's place in the tiles of these views.
    float2 node = btf_square(wi, reach.x) * (head.x - 1.0) + 0.5, size, place[3];
    btf_mean.GetDimensions(size.x, size.y);
    float3 sum = 0.0;
    for (int v = 0; v < 3; v++) {
        float row = floor((ids[v] + 0.5) / head.y);
        place[v] = (float2(ids[v] - row * head.y, row) * head.x + node) / size;
        sum += weight[v] * btf_mean.SampleLevel(btf_sampler, place[v], 0.0).rgb;
    }
    // Coarse levels do without the weak components.
    float share = saturate(1.0 - lod);
    int pairs = int(share > 0.0 ? head.w : head.z), scales = 4160 + int(reach.w), coarse = int(head.z);
    for (int i = 0; i < pairs; i++) {
        float2 c;
        if (i < coarse) c = btf_planes.SampleLevel(btf_sampler, float3(uv, i), lod).rg;
        else c = btf_fine.SampleLevel(btf_sampler, float3(uv, i - coarse), 0.0).rg;
        c = (c - 128.0 / 255.0) * btf_table(scales + i).xy * (i < coarse ? 1.0 : share);
        for (int v = 0; v < 3; v++)
            sum += weight[v] * (c.x * (btf_bases.SampleLevel(btf_sampler, float3(place[v], 2 * i), 0.0).rgb - 128.0 / 255.0)
                              + c.y * (btf_bases.SampleLevel(btf_sampler, float3(place[v], 2 * i + 1), 0.0).rgb - 128.0 / 255.0));
    }
    return pow(max(sum, 0.0), 2.4) * min(wi.z / reach.y, 1.0) * min(wi.z / reach.z, 1.0);
}
