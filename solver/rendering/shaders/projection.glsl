// From local coordinates to clip space; rows run downwards, as they are stored.

layout(std430, binding = 0) readonly buffer Facings { int facing[]; };  // by patch

const int HIDDEN = 2;  // a patch of which only the front exists, seen from behind

uniform vec3 eye;        // local
uniform vec3 eye_rest;   // what float32 leaves of the eye
uniform vec3 right;      // over the tangent of half the horizontal angle of view
uniform vec3 down;       // over the tangent of half the vertical angle of view
uniform vec3 forward;
uniform vec2 jitter;     // clip space
uniform float near;      // local

vec4 project(vec3 position, int patch_index) {
    if (facing[patch_index] == HIDDEN) {
        return vec4(2.0, 2.0, 2.0, 1.0);  // outside, as all vertices of its triangles
    }
    vec3 ray = (position - eye) - eye_rest;
    float depth = dot(ray, forward);
    return vec4(dot(ray, right) + jitter.x * depth, dot(ray, down) + jitter.y * depth, near, depth);
}
