// A frame's share in the mean of many.

uniform sampler2D frame;
uniform float share;

layout(location = 0) out vec4 colour;

void main() {
    colour = share * texelFetch(frame, ivec2(gl_FragCoord.xy), 0);
}
