// @ts-check
/**
 * A square of pixels that is drawn out of sight and read back: which block is at a place, and what colour a mark has.
 *
 * Consumes a scene and draws with its own shaders, so what is read is what is shown.
 */

/** Side of the square, device pixels, odd. */
const PROBE = 11;

const NO_PROJECTION = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

class Probe {
  /** @param {Scene} scene */
  constructor(scene) {
    const gl = scene.gl;
    this.scene = scene;
    this.framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    for (const [format, point] of [
      [gl.RGBA8, gl.COLOR_ATTACHMENT0],
      [gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT],
    ]) {
      const store = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, store);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, PROBE, PROBE);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, point, gl.RENDERBUFFER, store);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  /** The pixels of what is drawn, RGBA, from the lowest row up.
   * @param {() => void} draw */
  read(draw) {
    const gl = this.scene.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.viewport(0, 0, PROBE, PROBE);
    this.scene.setBlending(false);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    draw();
    const pixels = new Uint8Array(4 * PROBE * PROBE);
    gl.readPixels(0, 0, PROBE, PROBE, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return pixels;
  }

  /**
   * The block at a place of the picture, -1 for none: that of the nearest mark in reach, else that of the part there.
   * @param {Look} look @param {number} x CSS pixels from the left @param {number} y from the top
   */
  pick(look, x, y) {
    const { gl, canvas } = this.scene;
    const ratio = canvas.width / look.camera.width;
    const [px, py] = [x * ratio, canvas.height - y * ratio];
    const [sx, sy] = [canvas.width / PROBE, canvas.height / PROBE];
    const [tx, ty] = [sx * (1 - (2 * px) / canvas.width), sy * (1 - (2 * py) / canvas.height)];
    const part = [sx, 0, 0, 0, 0, sy, 0, 0, 0, 0, 1, 0, tx, ty, 0, 1];
    const projection = product(part, look.camera.matrices().projection);
    const pixels = this.read(() => {
      gl.enable(gl.DEPTH_TEST);
      this.scene.drawMesh(look, projection, ratio, true);
      if (!this.scene.drawsMarks) return;
      this.scene.beginMarks(look, projection, [PROBE, PROBE], ratio, true);
      for (const k of this.scene.chunksInSight(look)) this.scene.drawChunk(k, 0, Infinity, 1);
    });
    const middle = (PROBE - 1) / 2;
    let [best, near] = [-1, Infinity];
    for (let i = 0; i < PROBE * PROBE; i++) {
      const id = pixels[4 * i] | (pixels[4 * i + 1] << 8) | (pixels[4 * i + 2] << 16);
      const d = Math.hypot((i % PROBE) - middle, Math.floor(i / PROBE) - middle);
      const isMark = pixels[4 * i + 3] === 255;
      if (id > 0 && (isMark || d === 0) && (isMark ? d : 100) < near) [best, near] = [id - 1, isMark ? d : 100];
    }
    return best;
  }

  /** The colour that the shader gives to a point of a mark, null where it is not drawn.
   * @param {Look} look @param {number} k of the chunk @param {number} point @returns {Colour|null} */
  colourOfPoint(look, k, point) {
    const chunk = this.scene.chunks[k];
    if (!chunk) return null;
    const { gl, blocks, markProgram } = this.scene;
    const [x, y, z] = pointInPart(blocks, chunk.data, point);
    const pixels = this.read(() => {
      gl.disable(gl.DEPTH_TEST);
      this.scene.beginMarks(look, NO_PROJECTION, [PROBE, PROBE], 1, false);
      this.scene.setBlending(false);
      markProgram.floats({ uView: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -x, -y, -z, 1], uBias: 0, uDot: 5, uSize: [5, 5] });
      markProgram.floats({ uOpacity: [1, 1] });
      this.scene.isThin = false;
      markProgram.ints({ uAsDot: true });
      this.scene.drawChunk(k, point, point + 1, 1);
    });
    const middle = 4 * ((PROBE * PROBE - 1) / 2);
    return pixels[middle + 3] === 0 ? null : [pixels[middle], pixels[middle + 1], pixels[middle + 2]];
  }
}
