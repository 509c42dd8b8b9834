// The quadratic of the triangle that a pixel shows, at the point that it shows; see `triangle_frames`.

layout(binding = 0) uniform usampler2D identity;
layout(binding = 1) uniform usamplerBuffer frames;       // four texels a triangle
layout(binding = 2) uniform samplerBuffer coefficients;  // five texels a triangle
layout(binding = 3) uniform samplerBuffer materials;     // two texels a patch, both over pi

uniform bool is_radiance;  // otherwise irradiance
uniform dvec3 eye;         // local
uniform dvec3 first;       // the ray through the centre of the first pixel
uniform dvec3 across;      // what a pixel to the right adds to a ray
uniform dvec3 down;        // what a pixel further down adds

layout(location = 0) out vec4 colour;

const uint BACK = 0x80000000u;

void main() {
    uint shown = texelFetch(identity, ivec2(gl_FragCoord.xy), 0).x;
    if (shown == 0u || (shown & BACK) != 0u) {
        colour = vec4(0.0);
        return;
    }
    int triangle = int(shown) - 1;

    // The triangle's frame.
    uvec4 a = texelFetch(frames, 4 * triangle);
    uvec4 b = texelFetch(frames, 4 * triangle + 1);
    uvec4 c = texelFetch(frames, 4 * triangle + 2);
    uvec4 d = texelFetch(frames, 4 * triangle + 3);
    dvec3 origin = dvec3(packDouble2x32(a.xy), packDouble2x32(a.zw), packDouble2x32(b.xy));
    dvec3 normal = dvec3(packDouble2x32(b.zw), packDouble2x32(c.xy), 1.0lf);
    mat2 matrix = transpose(mat2(uintBitsToFloat(uvec4(c.zw, d.xy))));

    // Where the ray meets the plane.
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    dvec3 ray = first + double(pixel.x) * across + double(pixel.y) * down;
    dvec3 start = eye;
    if (d.z == 0u) {
        ray = ray.yzx;
        start = start.yzx;
    } else if (d.z == 1u) {
        ray = ray.zxy;
        start = start.zxy;
    }
    start -= origin;
    double falling = dot(normal, ray);
    double far = falling != 0.0lf ? -dot(normal, start) / falling : 0.0lf;
    vec2 st = max(matrix * vec2(start.xy + far * ray.xy), 0.0);
    st /= max(1.0, st.x + st.y);

    // [H eq. 3.1]
    vec4 p = texelFetch(coefficients, 5 * triangle);
    vec4 q = texelFetch(coefficients, 5 * triangle + 1);
    vec4 r = texelFetch(coefficients, 5 * triangle + 2);
    vec4 u = texelFetch(coefficients, 5 * triangle + 3);
    vec4 v = texelFetch(coefficients, 5 * triangle + 4);
    vec3 light = st.x * (p.xyz * st.x + vec3(p.w, q.xy) * st.y + vec3(q.zw, r.x))
        + st.y * (r.yzw * st.y + u.xyz)
        + vec3(u.w, v.xy);
    light = max(light, 0.0);
    if (is_radiance) {
        int patch_index = int(d.w);
        light = light * texelFetch(materials, 2 * patch_index).rgb + texelFetch(materials, 2 * patch_index + 1).rgb;
    }
    colour = vec4(light, 1.0);
}
