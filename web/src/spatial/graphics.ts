// What a browser draws with, as far as it says so.

/** The name of whatever draws in a context. */
export function rendererName(gl: WebGLRenderingContext | WebGL2RenderingContext): string {
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

/** Whether a processor draws in place of a graphics card: what costs a card nothing takes it long. */
export function isSoftware(gl: WebGLRenderingContext | WebGL2RenderingContext): boolean {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(rendererName(gl));
}

/** What draws here: nothing, a graphics card, or the processor in its place. */
export type Graphics = "none" | "card" | "software";

let known: Graphics | null = null;

/** What this browser draws with; found out once. */
export function graphics(): Graphics {
  return (known ??= probe());
}

function probe(): Graphics {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return "none";
  const found = isSoftware(gl) ? "software" : "card";
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return found;
}
