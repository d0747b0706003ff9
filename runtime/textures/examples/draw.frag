// A ball and a ground of one material under a lamp, by rays. After the decoder, which has group 0.
layout(set = 1, binding = 0) uniform Scene { vec4 size_and_repeats; } scene;
layout(location = 0) out vec4 colour;

const vec3 EYE = vec3(0.0, 1.3, 4.2), LAMP = vec3(2.2, 4.0, 2.4), BALL = vec3(0.0, 0.0, 0.0);

void main() {
    vec2 half_size = 0.5 * scene.size_and_repeats.xy;
    vec2 p = (gl_FragCoord.xy - half_size) / half_size.y;
    vec3 ahead = normalize(BALL - vec3(0.0, 0.2, 0.0) - EYE), right = normalize(cross(ahead, vec3(0.0, 1.0, 0.0)));
    vec3 up = cross(right, ahead), ray = normalize(ahead * 2.9 + right * p.x - up * p.y);
    float b = dot(EYE - BALL, ray), d = b * b - dot(EYE - BALL, EYE - BALL) + 1.0;
    float to_ground = ray.y < 0.0 ? (-1.0 - EYE.y) / ray.y : -1.0;
    bool on_ball = d > 0.0;
    colour = vec4(0.0, 0.0, 0.0, 1.0);
    if (!on_ball && (to_ground < 0.0 || to_ground > 14.0)) return;
    vec3 at = EYE + ray * (on_ball ? -b - sqrt(d) : to_ground), n, t;
    vec2 uv;
    float texels_a_pixel;
    // Texels that a pixel covers: a pixel's width at this distance over a texel's, wider where the surface is seen flat.
    float pixel = length(at - EYE) / (2.9 * half_size.y), texels = float(textureSize(sampler2DArray(btf_planes, btf_sampler), 0).x);
    if (on_ball) {
        n = at - BALL;
        t = normalize(vec3(n.z, 0.0, -n.x) + vec3(1e-6, 0.0, 0.0));
        uv = vec2(atan(n.x, n.z) / 3.14159265, acos(clamp(n.y, -1.0, 1.0)) / 3.14159265) * scene.size_and_repeats.z;
        texels_a_pixel = pixel / 3.14159265 * scene.size_and_repeats.z * texels;
    } else {
        n = vec3(0.0, 1.0, 0.0);
        t = vec3(1.0, 0.0, 0.0);
        uv = at.xz / 3.14159265 * scene.size_and_repeats.z;
        texels_a_pixel = pixel / 3.14159265 * scene.size_and_repeats.z * texels;
    }
    vec3 to_lamp = LAMP - at, wi = normalize(to_lamp);
    // The ball's shadow.
    float c = dot(at - BALL, wi);
    if (!on_ball && c < 0.0 && c * c - dot(at - BALL, at - BALL) + 1.0 > 0.0) return;
    vec3 s = cross(n, t);
    mat3 frame = transpose(mat3(t, s, n));
    float lod = log2(max(1.0, texels_a_pixel / sqrt(max(0.05, dot(n, -ray)))));
    vec3 light = 60.0 / dot(to_lamp, to_lamp) * btf(uv, lod, frame * wi, frame * -ray);
    colour = vec4(pow(clamp(light, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}
