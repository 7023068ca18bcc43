"use strict";
// Material that takes light, and whether a processor draws in place of a graphics card.
mbsim.lit = (function () {
  function drawnByProcessor() {
    const gl = document.createElement("canvas").getContext("webgl2");
    if (!gl) { return false; }
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    const name = gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    const lose = gl.getExtension("WEBGL_lose_context");
    if (lose) { lose.loseContext(); }
    return /swiftshader|llvmpipe|softpipe|software/i.test(name);
  }

  // Pictures are as good as can be, whoever draws them.
  const slow = location.hash !== "#picture" && drawnByProcessor();

  // Where a frame takes long its light is matt: shaders are compiled and run in half the time.
  function material(facts, roughness, metalness) {
    return slow ? new THREE.MeshLambertMaterial(facts) : new THREE.MeshStandardMaterial({ ...facts, roughness, metalness });
  }
  return { slow, material };
})();
