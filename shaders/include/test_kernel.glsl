// What every kernel of shaders/test/ begins with: the bindings, and `lane` with `inputs` and `outputs`.
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_shader_subgroup_basic : require
#if TRACE_BACKEND == 1
#extension GL_EXT_ray_query : require
#endif
#if ARRAY_FORM == 2
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#endif
layout(local_size_x_id = 0, local_size_y = 1, local_size_z = 1) in;

#include "layout.glsl"
layout(set = 0, binding = 0, std140) uniform RenderConstantsBlock { RenderConstants constants; };
layout(set = 0, binding = 1, std430) readonly buffer InputBlock { uvec4 inputs[]; };
layout(set = 0, binding = 2, std430) writeonly buffer OutputBlock { uvec4 outputs[]; };
layout(push_constant) uniform LaneBlock { uint lanes; };
