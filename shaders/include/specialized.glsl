// Constants of the kernel key: specialisation constants, or, where the shader is compiled for one key alone, plain ones
// that the host defines as SPECIALIZED_0, SPECIALIZED_1 and so on (src/render/path_tracer.rs).
#ifndef SPECIALIZED_GLSL
#define SPECIALIZED_GLSL
#ifdef SPECIALIZED
#define SPECIALIZED_CONSTANT(id, name, fallback) const uint name = SPECIALIZED_##id;
#else
#define SPECIALIZED_CONSTANT(id, name, fallback) layout(constant_id = id) const uint name = fallback;
#endif
#endif
