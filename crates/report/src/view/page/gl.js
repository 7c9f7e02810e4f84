// @ts-check
/**
 * What WebGL2 is asked for, made short: programs, textures and buffers.
 *
 * Promises an error in words where a shader does not compile or a texture is too large for the graphics card.
 */

/** A program and the places of its uniforms. */
class Program {
  /** @param {WebGL2RenderingContext} gl @param {string} vertex @param {string} fragment */
  constructor(gl, vertex, fragment) {
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, text] of /** @type {[number, string][]} */ ([
      [gl.VERTEX_SHADER, vertex],
      [gl.FRAGMENT_SHADER, fragment],
    ])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, `#version 300 es\nprecision highp float;\nprecision highp int;\n${text}`);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(`a shader of the page does not compile here: ${gl.getShaderInfoLog(shader)}`);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(`the shaders of the page do not link here: ${gl.getProgramInfoLog(this.program)}`);
    /** @type {Map<string, WebGLUniformLocation|null>} */
    this.places = new Map();
  }

  use() {
    this.gl.useProgram(this.program);
  }

  /** @param {string} uniform */
  at(uniform) {
    let place = this.places.get(uniform);
    if (place === undefined) {
      place = this.gl.getUniformLocation(this.program, uniform);
      this.places.set(uniform, place);
    }
    return place;
  }

  /** Sets numbers, vectors and matrices by the count of their values.
   * @param {Record<string, number|readonly number[]>} values */
  floats(values) {
    const gl = this.gl;
    for (const [uniform, value] of Object.entries(values)) {
      const at = this.at(uniform);
      if (typeof value === "number") gl.uniform1f(at, value);
      else if (value.length === 2) gl.uniform2fv(at, value);
      else if (value.length === 3) gl.uniform3fv(at, value);
      else if (value.length === 4) gl.uniform4fv(at, value);
      else gl.uniformMatrix4fv(at, false, value);
    }
  }

  /** @param {Record<string, number|boolean>} values */
  ints(values) {
    for (const [uniform, value] of Object.entries(values)) this.gl.uniform1i(this.at(uniform), Number(value));
  }
}

/** A texture of values that are read as they are, without a mean of neighbours. */
class Values {
  /** @param {WebGL2RenderingContext} gl @param {number} inner @param {number} format @param {number} type */
  constructor(gl, inner, format, type) {
    this.gl = gl;
    this.inner = inner;
    this.format = format;
    this.type = type;
    this.texture = gl.createTexture();
    this.width = 0;
    this.height = 0;
  }

  /** @param {number} width @param {number} height @param {ArrayBufferView} values */
  set(width, height, values) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    if (width === this.width && height === this.height) {
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, this.format, this.type, values);
      return;
    }
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (width > most || height > most)
      throw new Error(`a map of ${width} by ${height} cells is too large for this graphics card, which takes ${most}`);
    gl.texImage2D(gl.TEXTURE_2D, 0, this.inner, width, height, 0, this.format, this.type, values);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const way of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, way, gl.NEAREST);
    this.width = width;
    this.height = height;
  }

  /** @param {number} unit */
  bind(unit) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.texture);
  }
}

/** A texture of bytes of which a place has the mean over the pixel that shows it. */
class Means {
  /** @param {WebGL2RenderingContext} gl @param {number} width @param {number} height @param {Uint8Array} bytes */
  constructor(gl, width, height, bytes) {
    this.gl = gl;
    this.texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.R8, width, height, 0, gl.RED, gl.UNSIGNED_BYTE, bytes);
    gl.generateMipmap(gl.TEXTURE_2D);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  }

  /** @param {number} unit */
  bind(unit) {
    this.gl.activeTexture(this.gl.TEXTURE0 + unit);
    this.gl.bindTexture(this.gl.TEXTURE_2D, this.texture);
  }
}

/** @param {WebGL2RenderingContext} gl @param {number} target @param {ArrayBufferView<ArrayBuffer>} values */
function bufferOf(gl, target, values) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(target, buffer);
  gl.bufferData(target, values, gl.STATIC_DRAW);
  return buffer;
}
