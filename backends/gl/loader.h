// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <GL/glcorearb.h>

#include <string_view>
#include <vector>

#include "core/error.h"

/// @file
/// The OpenGL functions that this backend calls, loaded at run time: nothing links to a driver.
///
///     NACRE_TRY(Functions gl, load_functions(get_address, /*es=*/false));
///     gl.BindBuffer(GL_ARRAY_BUFFER, name);

namespace nacre::gl {

// Functions of OpenGL 4.5 core that OpenGL ES 3.1 has under the same name.
#define NACRE_GL_COMMON_FUNCTIONS(X)                                                                               \
    X(ActiveTexture, ACTIVETEXTURE) X(AttachShader, ATTACHSHADER) X(BeginQuery, BEGINQUERY)                        \
    X(BindBuffer, BINDBUFFER) X(BindBufferBase, BINDBUFFERBASE) X(BindBufferRange, BINDBUFFERRANGE)                \
    X(BindFramebuffer, BINDFRAMEBUFFER) X(BindImageTexture, BINDIMAGETEXTURE) X(BindSampler, BINDSAMPLER)          \
    X(BindTexture, BINDTEXTURE) X(BindVertexArray, BINDVERTEXARRAY) X(BindVertexBuffer, BINDVERTEXBUFFER)          \
    X(BlendColor, BLENDCOLOR) X(BlendEquationSeparate, BLENDEQUATIONSEPARATE)                                      \
    X(BlendFuncSeparate, BLENDFUNCSEPARATE) X(BlitFramebuffer, BLITFRAMEBUFFER) X(BufferData, BUFFERDATA)          \
    X(BufferSubData, BUFFERSUBDATA) X(CheckFramebufferStatus, CHECKFRAMEBUFFERSTATUS)                              \
    X(ClearBufferfi, CLEARBUFFERFI) X(ClearBufferfv, CLEARBUFFERFV) X(ClearBufferiv, CLEARBUFFERIV)                \
    X(ClearBufferuiv, CLEARBUFFERUIV) X(ClientWaitSync, CLIENTWAITSYNC) X(ColorMask, COLORMASK)                    \
    X(CompileShader, COMPILESHADER) X(CompressedTexSubImage2D, COMPRESSEDTEXSUBIMAGE2D)                            \
    X(CompressedTexSubImage3D, COMPRESSEDTEXSUBIMAGE3D) X(CopyBufferSubData, COPYBUFFERSUBDATA)                    \
    X(CreateProgram, CREATEPROGRAM) X(CreateShader, CREATESHADER) X(CullFace, CULLFACE)                            \
    X(DeleteBuffers, DELETEBUFFERS) X(DeleteFramebuffers, DELETEFRAMEBUFFERS) X(DeleteProgram, DELETEPROGRAM)      \
    X(DeleteQueries, DELETEQUERIES) X(DeleteSamplers, DELETESAMPLERS) X(DeleteShader, DELETESHADER)                \
    X(DeleteSync, DELETESYNC) X(DeleteTextures, DELETETEXTURES) X(DeleteVertexArrays, DELETEVERTEXARRAYS)          \
    X(DepthFunc, DEPTHFUNC) X(DepthMask, DEPTHMASK) X(DepthRangef, DEPTHRANGEF) X(Disable, DISABLE)                \
    X(DispatchCompute, DISPATCHCOMPUTE) X(DispatchComputeIndirect, DISPATCHCOMPUTEINDIRECT)                        \
    X(DrawArrays, DRAWARRAYS) X(DrawArraysIndirect, DRAWARRAYSINDIRECT)                                            \
    X(DrawArraysInstanced, DRAWARRAYSINSTANCED) X(DrawBuffers, DRAWBUFFERS)                                        \
    X(DrawElementsIndirect, DRAWELEMENTSINDIRECT) X(DrawElementsInstanced, DRAWELEMENTSINSTANCED)                  \
    X(Enable, ENABLE) X(EnableVertexAttribArray, ENABLEVERTEXATTRIBARRAY) X(EndQuery, ENDQUERY)                    \
    X(FenceSync, FENCESYNC) X(Finish, FINISH) X(Flush, FLUSH) X(FramebufferTexture2D, FRAMEBUFFERTEXTURE2D)        \
    X(FramebufferTextureLayer, FRAMEBUFFERTEXTURELAYER) X(FrontFace, FRONTFACE) X(GenBuffers, GENBUFFERS)          \
    X(GenFramebuffers, GENFRAMEBUFFERS) X(GenQueries, GENQUERIES) X(GenSamplers, GENSAMPLERS)                      \
    X(GenTextures, GENTEXTURES) X(GenVertexArrays, GENVERTEXARRAYS) X(GenerateMipmap, GENERATEMIPMAP)              \
    X(GetError, GETERROR) X(GetFloatv, GETFLOATV) X(GetInteger64v, GETINTEGER64V)                                  \
    X(GetIntegeri_v, GETINTEGERI_V) X(GetIntegerv, GETINTEGERV) X(GetInternalformativ, GETINTERNALFORMATIV)        \
    X(GetProgramBinary, GETPROGRAMBINARY) X(GetProgramInfoLog, GETPROGRAMINFOLOG) X(GetProgramiv, GETPROGRAMIV)    \
    X(GetQueryObjectuiv, GETQUERYOBJECTUIV) X(GetShaderInfoLog, GETSHADERINFOLOG) X(GetShaderiv, GETSHADERIV)      \
    X(GetString, GETSTRING) X(GetStringi, GETSTRINGI) X(GetUniformLocation, GETUNIFORMLOCATION)                    \
    X(InvalidateFramebuffer, INVALIDATEFRAMEBUFFER) X(LineWidth, LINEWIDTH) X(LinkProgram, LINKPROGRAM)            \
    X(MapBufferRange, MAPBUFFERRANGE) X(MemoryBarrier, MEMORYBARRIER) X(PixelStorei, PIXELSTOREI)                  \
    X(PolygonOffset, POLYGONOFFSET) X(ProgramBinary, PROGRAMBINARY) X(ProgramParameteri, PROGRAMPARAMETERI)        \
    X(ReadBuffer, READBUFFER) X(ReadPixels, READPIXELS) X(SamplerParameterf, SAMPLERPARAMETERF)                    \
    X(SamplerParameteri, SAMPLERPARAMETERI) X(Scissor, SCISSOR) X(ShaderSource, SHADERSOURCE)                      \
    X(StencilFuncSeparate, STENCILFUNCSEPARATE) X(StencilMaskSeparate, STENCILMASKSEPARATE)                        \
    X(StencilOpSeparate, STENCILOPSEPARATE) X(TexParameteri, TEXPARAMETERI) X(TexStorage2D, TEXSTORAGE2D)          \
    X(TexStorage2DMultisample, TEXSTORAGE2DMULTISAMPLE) X(TexStorage3D, TEXSTORAGE3D)                              \
    X(TexSubImage2D, TEXSUBIMAGE2D) X(TexSubImage3D, TEXSUBIMAGE3D) X(Uniform1fv, UNIFORM1FV)                      \
    X(Uniform1i, UNIFORM1I) X(Uniform1iv, UNIFORM1IV) X(Uniform1uiv, UNIFORM1UIV) X(Uniform2fv, UNIFORM2FV)        \
    X(Uniform2iv, UNIFORM2IV) X(Uniform2uiv, UNIFORM2UIV) X(Uniform3fv, UNIFORM3FV) X(Uniform3iv, UNIFORM3IV)      \
    X(Uniform3uiv, UNIFORM3UIV) X(Uniform4fv, UNIFORM4FV) X(Uniform4iv, UNIFORM4IV) X(Uniform4uiv, UNIFORM4UIV)    \
    X(UniformMatrix2fv, UNIFORMMATRIX2FV) X(UniformMatrix2x3fv, UNIFORMMATRIX2X3FV)                                \
    X(UniformMatrix2x4fv, UNIFORMMATRIX2X4FV) X(UniformMatrix3fv, UNIFORMMATRIX3FV)                                \
    X(UniformMatrix3x2fv, UNIFORMMATRIX3X2FV) X(UniformMatrix3x4fv, UNIFORMMATRIX3X4FV)                            \
    X(UniformMatrix4fv, UNIFORMMATRIX4FV) X(UniformMatrix4x2fv, UNIFORMMATRIX4X2FV)                                \
    X(UniformMatrix4x3fv, UNIFORMMATRIX4X3FV) X(UnmapBuffer, UNMAPBUFFER) X(UseProgram, USEPROGRAM)                \
    X(VertexAttribBinding, VERTEXATTRIBBINDING) X(VertexAttribFormat, VERTEXATTRIBFORMAT)                          \
    X(VertexAttribIFormat, VERTEXATTRIBIFORMAT) X(VertexBindingDivisor, VERTEXBINDINGDIVISOR)                      \
    X(Viewport, VIEWPORT)

// Functions that OpenGL 4.5 has and OpenGL ES has only by a later version or an extension: name there.
#define NACRE_GL_OPTIONAL_FUNCTIONS(X)                                                                             \
    X(BlendEquationSeparatei, BLENDEQUATIONSEPARATEI, "glBlendEquationSeparatei")                                  \
    X(BlendFuncSeparatei, BLENDFUNCSEPARATEI, "glBlendFuncSeparatei")                                              \
    X(BufferStorage, BUFFERSTORAGE, "glBufferStorageEXT")                                                          \
    X(ClearBufferSubData, CLEARBUFFERSUBDATA, "")                                                                  \
    X(ClearTexSubImage, CLEARTEXSUBIMAGE, "glClearTexSubImageEXT")                                                 \
    X(ClipControl, CLIPCONTROL, "glClipControlEXT")                                                                \
    X(ColorMaski, COLORMASKI, "glColorMaski")                                                                      \
    X(CompressedTextureSubImage1D, COMPRESSEDTEXTURESUBIMAGE1D, "")                                                \
    X(CopyImageSubData, COPYIMAGESUBDATA, "glCopyImageSubData")                                                    \
    X(DebugMessageCallback, DEBUGMESSAGECALLBACK, "glDebugMessageCallbackKHR")                                     \
    X(DebugMessageControl, DEBUGMESSAGECONTROL, "glDebugMessageControlKHR")                                        \
    X(Disablei, DISABLEI, "glDisablei")                                                                            \
    X(DrawArraysInstancedBaseInstance, DRAWARRAYSINSTANCEDBASEINSTANCE, "glDrawArraysInstancedBaseInstanceEXT")    \
    X(DrawElementsInstancedBaseVertex, DRAWELEMENTSINSTANCEDBASEVERTEX, "glDrawElementsInstancedBaseVertex")       \
    X(DrawElementsInstancedBaseVertexBaseInstance, DRAWELEMENTSINSTANCEDBASEVERTEXBASEINSTANCE,                    \
      "glDrawElementsInstancedBaseVertexBaseInstanceEXT")                                                          \
    X(Enablei, ENABLEI, "glEnablei")                                                                               \
    X(FramebufferTexture1D, FRAMEBUFFERTEXTURE1D, "")                                                              \
    X(GetCompressedTextureSubImage, GETCOMPRESSEDTEXTURESUBIMAGE, "")                                              \
    X(GetGraphicsResetStatus, GETGRAPHICSRESETSTATUS, "glGetGraphicsResetStatus")                                  \
    X(GetQueryObjectui64v, GETQUERYOBJECTUI64V, "glGetQueryObjectui64vEXT")                                        \
    X(GetTextureSubImage, GETTEXTURESUBIMAGE, "")                                                                  \
    X(MultiDrawArraysIndirect, MULTIDRAWARRAYSINDIRECT, "glMultiDrawArraysIndirectEXT")                            \
    X(MultiDrawElementsIndirect, MULTIDRAWELEMENTSINDIRECT, "glMultiDrawElementsIndirectEXT")                      \
    X(ObjectLabel, OBJECTLABEL, "glObjectLabelKHR")                                                                \
    X(PointParameteri, POINTPARAMETERI, "")                                                                        \
    X(PolygonMode, POLYGONMODE, "glPolygonModeNV")                                                                 \
    X(PolygonOffsetClamp, POLYGONOFFSETCLAMP, "glPolygonOffsetClampEXT")                                           \
    X(PopDebugGroup, POPDEBUGGROUP, "glPopDebugGroupKHR")                                                          \
    X(ProvokingVertex, PROVOKINGVERTEX, "")                                                                        \
    X(PushDebugGroup, PUSHDEBUGGROUP, "glPushDebugGroupKHR")                                                       \
    X(QueryCounter, QUERYCOUNTER, "glQueryCounterEXT")                                                             \
    X(SamplerParameterIiv, SAMPLERPARAMETERIIV, "glSamplerParameterIiv")                                           \
    X(SamplerParameterfv, SAMPLERPARAMETERFV, "glSamplerParameterfv")                                              \
    X(TexBufferRange, TEXBUFFERRANGE, "glTexBufferRange")                                                          \
    X(TexStorage1D, TEXSTORAGE1D, "")                                                                              \
    X(TexStorage3DMultisample, TEXSTORAGE3DMULTISAMPLE, "glTexStorage3DMultisample")                               \
    X(TexSubImage1D, TEXSUBIMAGE1D, "")                                                                            \
    X(TextureView, TEXTUREVIEW, "glTextureViewOES")                                                                \
    X(ViewportIndexedf, VIEWPORTINDEXEDF, "")

/// One table for each device: two drivers in one process (EGL and OSMesa, say) have different addresses.
struct Functions {
#define NACRE_GL_MEMBER(name, type) PFNGL##type##PROC name = nullptr;
#define NACRE_GL_OPTIONAL_MEMBER(name, type, es_name) PFNGL##type##PROC name = nullptr;
    NACRE_GL_COMMON_FUNCTIONS(NACRE_GL_MEMBER)
    NACRE_GL_OPTIONAL_FUNCTIONS(NACRE_GL_OPTIONAL_MEMBER)
#undef NACRE_GL_MEMBER
#undef NACRE_GL_OPTIONAL_MEMBER
};

/// eglGetProcAddress or OSMesaGetProcAddress.
using GetAddress = void (*(*)(const char*))();

/// Loads all functions. An address alone does not say that a function may be called: loaders hand out stubs for any
/// name; `Traits` (traits.h) decides by version and extensions. Errors: unsupported, names the first missing function.
Expected<Functions> load_functions(GetAddress get_address, bool es);

}  // namespace nacre::gl
