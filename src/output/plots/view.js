// The view of bodies in report.html, which solids can be turned in. It needs WebGL; without WebGL the still picture stays.
(function () {
  "use strict";

  const VERTEX = `
    attribute vec3 place, displacement, normal;
    attribute float value;
    uniform mat3 camera;
    uniform vec3 centre;
    uniform vec4 fit;
    uniform float magnified, depth, lift, scale, size;
    varying vec3 facing;
    varying float shown;
    void main() {
      vec3 seen = camera * (place + magnified * displacement - centre);
      gl_Position = vec4(seen.xy * fit.xy + fit.zw, -seen.z * depth - lift, 1.0);
      gl_PointSize = size;
      facing = camera * normal;
      shown = value < -0.5 ? value : value * scale;
    }`;

  // Faces in space are lit from the left above the viewer: brighter towards white, darker towards black.
  const FACES = `
    precision mediump float;
    varying vec3 facing;
    varying float shown;
    uniform sampler2D colours;
    uniform vec4 plain;
    uniform float lit;
    void main() {
      vec3 colour = vec3(0.80);
      if (plain.a > 0.5) colour = plain.rgb;
      else if (shown > -0.5) colour = texture2D(colours, vec2(clamp(shown, 0.0, 1.0) * 0.996 + 0.002, 0.5)).rgb;
      float light = lit * (2.0 * max(dot(normalize(facing), normalize(vec3(-0.35, 0.45, 1.0))), 0.0) - 1.0);
      gl_FragColor = vec4(light > 0.0 ? mix(colour, vec3(1.0), 0.20 * light) : colour * (1.0 + 0.33 * light), 1.0);
    }`;

  const LINES = `
    precision mediump float;
    uniform vec4 plain;
    void main() { gl_FragColor = plain; }`;

  const DOTS = `
    precision mediump float;
    uniform vec4 plain;
    void main() {
      float far = length(gl_PointCoord - 0.5);
      if (far > 0.5) discard;
      gl_FragColor = far > 0.38 ? vec4(0.13, 0.13, 0.13, 1.0) : plain;
    }`;

  // Of parts; after Okabe and Ito, lighter.
  const PARTS = [[0.55, 0.72, 0.86], [0.93, 0.68, 0.45], [0.55, 0.78, 0.68], [0.83, 0.62, 0.76],
    [0.94, 0.89, 0.55], [0.70, 0.70, 0.70], [0.64, 0.85, 0.95], [0.88, 0.55, 0.50]];

  function bytes(text) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
  }

  function element(kind, parent, properties) {
    const made = document.createElement(kind);
    Object.assign(made, properties || {});
    if (parent) parent.appendChild(made);
    return made;
  }

  // The surface: places, facets, edges.
  function surface(data) {
    const places = Float32Array.from(new Uint16Array(bytes(data.places)), (v, i) => (v / 65535) * data.size[i % 3]);
    const normals = Float32Array.from(new Int8Array(bytes(data.normals)), (v) => v / 127);
    const corners = new Uint32Array(bytes(data.facets)), triangles = [];
    // The start of each facet's triangles; a facet with three corners repeats the last of them.
    const begin = [0];
    for (let f = 0; f < corners.length; f += 4) {
      const [a, b, c, d] = corners.subarray(f, f + 4);
      triangles.push(a, b, c);
      if (c !== d) triangles.push(a, c, d);
      begin.push(triangles.length);
    }
    return { count: places.length / 3, places, normals, corners, triangles: new Uint32Array(triangles), begin,
      edges: new Uint32Array(bytes(data.edges)) };
  }

  // The edges of all facets of a part, each once.
  function wires(shape, part, count) {
    const seen = new Set(), ends = [];
    for (let f = part.facets[0]; f < part.facets[1]; f++) {
      const nodes = shape.corners.subarray(4 * f, 4 * f + 4), n = nodes[2] === nodes[3] ? 3 : 4;
      for (let k = 0; k < n; k++) {
        const a = nodes[k], b = nodes[(k + 1) % n], key = Math.min(a, b) * count + Math.max(a, b);
        if (!seen.has(key)) {
          seen.add(key);
          ends.push(a, b);
        }
      }
    }
    return new Uint32Array(ends);
  }

  // The parts of a colour #rrggbb.
  function rgb(colour) {
    return [1, 3, 5].map((at) => parseInt(colour.substr(at, 2), 16) / 255);
  }

  // Displacements and fields of a step, and contact nodes by their states; far below zero where a field has no value.
  function step(data) {
    const displacement = Float32Array.from(new Int16Array(bytes(data.displacements)), (v) => (v / 32767) * data.travel);
    const part = (v) => (v === 65535 ? -1e4 : v / 65534);
    const fields = data.fields.map((of) => ({ ...of, values: Float32Array.from(new Uint16Array(bytes(of.values)), part) }));
    const dots = data.dots.map((of) => ({ colour: rgb(of.colour), vertices: new Uint32Array(bytes(of.vertices)) }));
    return { displacement, fields, dots, magnified: data.magnified };
  }

  // The directions to the right, up and to the viewer; z is upright.
  function axesOf(look) {
    const [s, c] = [Math.sin(look.azimuth), Math.cos(look.azimuth)];
    const [t, d] = [Math.sin(look.elevation), Math.cos(look.elevation)];
    return { right: [-s, c, 0], up: [-t * c, -t * s, d], back: [d * c, d * s, t] };
  }

  // How far the surface reaches around its middle, to the right and up, in both directions together.
  function extents(shape, size, { right, up }) {
    const most = [0, 0];
    for (let i = 0; i < shape.count; i++) {
      const x = [0, 1, 2].map((c) => shape.places[3 * i + c] - 0.5 * size[c]);
      [right, up].forEach((axis, k) => {
        most[k] = Math.max(most[k], 2 * Math.abs(axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2]));
      });
    }
    return most.map((v) => v || 1);
  }

  function program(gl, fragment) {
    const made = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    ["place", "displacement", "normal", "value"].forEach((name, k) => gl.bindAttribLocation(made, k, name));
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    const at = {};
    for (const name of ["camera", "centre", "fit", "magnified", "depth", "lift", "scale", "size", "lit", "colours", "plain"]) at[name] = gl.getUniformLocation(made, name);
    return { made, at };
  }

  function buffer(gl, kind, data) {
    const made = gl.createBuffer();
    gl.bindBuffer(kind, made);
    gl.bufferData(kind, data, gl.STATIC_DRAW);
    return made;
  }

  function palette(gl, stops) {
    const pixels = new Uint8Array(4 * 256);
    for (let i = 0; i < 256; i++) {
      const at = (i / 255) * (stops.length - 1), k = Math.min(Math.floor(at), stops.length - 2);
      for (let c = 0; c < 3; c++) pixels[4 * i + c] = stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c]);
      pixels[4 * i + 3] = 255;
    }
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // The meaning of the colours of a field.
  function colourBar(legend, field, colours) {
    legend.textContent = "";
    element("div", legend, { textContent: field.unit });
    const strip = element("div", legend, { className: "strip" });
    strip.style.background = `linear-gradient(to top, ${colours.map((c) => `rgb(${c})`).join()})`;
    for (const [part, text] of field.ticks) {
      element("span", strip, { textContent: text }).style.bottom = `calc(${100 * part}% - .6em)`;
    }
    if (field.largest) element("div", legend, { textContent: `largest ${field.largest}` });
  }

  function entry(legend, className, colour, name) {
    const row = element("div", legend, { className });
    element("i", row).style.background = colour;
    row.append(name);
  }

  function nameParts(legend, parts) {
    legend.textContent = "";
    parts.forEach((part, k) => entry(legend, "part", `rgb(${PARTS[k % PARTS.length].map((v) => 255 * v)})`, part.name));
  }

  // The directions of the axes, in the lower left corner.
  function triad(overlay, { right, up, back }, axes, ratio) {
    const pen = overlay.getContext("2d"), long = 30 * ratio;
    const [x, y] = [48 * ratio, overlay.height - 48 * ratio];
    pen.clearRect(0, 0, overlay.width, overlay.height);
    pen.strokeStyle = pen.fillStyle = "#444";
    pen.lineWidth = 1.6 * ratio;
    pen.font = `${13 * ratio}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    for (const k of axes.sort((a, b) => back[a] - back[b])) {
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + long * right[k], y - long * up[k]);
      pen.stroke();
      pen.fillText("xyz"[k], x + 1.35 * long * right[k], y - 1.35 * long * up[k]);
    }
  }

  // Mouse, fingers, wheel and keys. `point` receives the point of the canvas under the pointer, or nothing.
  function listen(canvas, turn, shift, zoom, point) {
    const held = new Map();
    canvas.onpointerdown = (event) => {
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, [event.clientX, event.clientY]);
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => held.delete(event.pointerId);
    canvas.onpointermove = (event) => {
      const before = held.get(event.pointerId);
      if (!before) return point([event.offsetX, event.offsetY]);
      const now = [event.clientX, event.clientY], other = [...held].find(([id]) => id !== event.pointerId);
      const [right, down] = [now[0] - before[0], now[1] - before[1]];
      held.set(event.pointerId, now);
      if (other) {
        const distance = (p) => Math.hypot(p[0] - other[1][0], p[1] - other[1][1]) || 1;
        const frame = canvas.getBoundingClientRect(), middle = [0, 1].map((c) => 0.5 * (now[c] + other[1][c]));
        zoom(distance(now) / distance(before), middle[0] - frame.left, middle[1] - frame.top);
        shift(0.5 * right, 0.5 * down);
      } else if (event.shiftKey || event.buttons & 6) shift(right, down);
      else turn(0.01 * right, 0.01 * down);
    };
    canvas.onpointerleave = () => point(null);
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.onkeydown = (event) => {
      const larger = (by) => zoom(by, 0.5 * canvas.clientWidth, 0.5 * canvas.clientHeight);
      const keys = { ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
        ArrowDown: () => turn(0, 0.1), Enter: () => point([0.5 * canvas.clientWidth, 0.5 * canvas.clientHeight]), "+": () => larger(1.2), "-": () => larger(1 / 1.2) };
      if (!keys[event.key] || event.ctrlKey || event.metaKey) return;
      event.preventDefault();
      keys[event.key]();
    };
  }

  // The data on the GPU, and their drawing.
  class Painter {
    constructor(gl, data, shape) {
      Object.assign(this, { gl, shape, parts: data.parts, size: data.size, lit: data.plane ? 0 : 1 });
      this.radius = 0.5 * Math.hypot(...this.size);
      this.faces = program(gl, FACES);
      this.lines = program(gl, LINES);
      this.dots = program(gl, DOTS);
      this.triangles = buffer(gl, gl.ELEMENT_ARRAY_BUFFER, shape.triangles);
      this.sharp = buffer(gl, gl.ELEMENT_ARRAY_BUFFER, shape.edges);
      this.places = buffer(gl, gl.ARRAY_BUFFER, shape.places);
      this.normals = buffer(gl, gl.ARRAY_BUFFER, shape.normals);
      for (const name of ["moved", "values", "obstacles", "at"]) this[name] = gl.createBuffer();
      // The edges of the elements of each part, made when they are first drawn.
      this.wires = this.parts.map(() => null);
      palette(gl, data.colours);
      gl.enable(gl.DEPTH_TEST);
      // Of lines in one place the later is seen.
      gl.depthFunc(gl.LEQUAL);
      gl.clearColor(1, 1, 1, 1);
      gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    }

    fill(which, array) {
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this[which]);
      this.gl.bufferData(this.gl.ARRAY_BUFFER, array, this.gl.STATIC_DRAW);
    }

    // From the length of the model to the stage, which reaches from −1 to 1.
    fit(look) {
      const { width, height } = this.gl.canvas;
      const unit = look.zoom * Math.min((0.8 * width) / look.extent[0], (0.86 * height) / look.extent[1]);
      return [(2 * unit) / width, (2 * unit) / height, look.pan[0], look.pan[1]];
    }

    // The visible point of the stage: the part, the vertices of the triangle and their weights.
    pick(look, shown, x, y) {
      const { places, triangles, begin } = this.shape, { right, up, back } = axesOf(look), fit = this.fit(look);
      const moved = shown.displacement, centre = this.size.map((v) => 0.5 * v);
      const along = (axis, i) => [0, 1, 2].reduce((sum, c) => sum + axis[c] * (places[3 * i + c] + shown.factor * moved[3 * i + c] - centre[c]), 0);
      const of = [...fit, look.azimuth, look.elevation, shown.factor, shown.step].join();
      if (this.projected?.of !== of) {
        const count = this.shape.count, at = new Float32Array(3 * count);
        for (let i = 0; i < count; i++) {
          at.set([along(right, i) * fit[0] + fit[2], along(up, i) * fit[1] + fit[3], along(back, i)], 3 * i);
        }
        this.projected = { of, at };
      }
      const at = this.projected.at;
      let found = null;
      this.parts.forEach((part, k) => {
        if (shown.hidden[k]) return;
        for (let t = begin[part.facets[0]]; t < begin[part.facets[1]]; t += 3) {
          const a = 3 * triangles[t], b = 3 * triangles[t + 1], c = 3 * triangles[t + 2], px = x - at[a], py = y - at[a + 1];
          const bx = at[b] - at[a], by = at[b + 1] - at[a + 1], cx = at[c] - at[a], cy = at[c + 1] - at[a + 1];
          const area = bx * cy - by * cx, v = (px * cy - py * cx) / area, w = (bx * py - by * px) / area;
          if (!(v >= 0 && w >= 0 && v + w <= 1)) continue;
          const weights = [1 - v - w, v, w], near = weights[0] * at[a + 2] + v * at[b + 2] + w * at[c + 2];
          if (!found || near > found.near) found = { near, part: k, vertices: [a / 3, b / 3, c / 3], weights };
        }
      });
      return found;
    }

    // Turns to a program, with lines lifted a little towards the viewer.
    use(which, look, shown, lift) {
      const { gl } = this, { right, up, back } = axesOf(look);
      gl.useProgram(which.made);
      gl.uniformMatrix3fv(which.at.camera, false, [0, 1, 2].flatMap((k) => [right[k], up[k], back[k]]));
      gl.uniform3fv(which.at.centre, this.size.map((v) => 0.5 * v));
      gl.uniform4f(which.at.fit, ...this.fit(look));
      gl.uniform1f(which.at.scale, shown.scale);
      gl.uniform1f(which.at.magnified, shown.factor);
      gl.uniform1f(which.at.depth, 1 / (3 * this.radius));
      gl.uniform1f(which.at.lift, lift / look.zoom);
      gl.uniform4f(which.at.plain, 0, 0, 0, 0);
      return which.at;
    }

    paint(look, shown) {
      const { gl } = this;
      gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      [["places", 3], ["moved", 3], ["normals", 3], ["values", 1]].forEach(([name, length], k) => {
        gl.bindBuffer(gl.ARRAY_BUFFER, this[name]);
        gl.enableVertexAttribArray(k);
        gl.vertexAttribPointer(k, length, gl.FLOAT, false, 0, 0);
      });
      const visible = this.parts.map((part, k) => ({ part, k })).filter(({ k }) => !shown.hidden[k]);
      this.paintFaces(this.use(this.faces, look, shown, 0), visible, shown);
      gl.enable(gl.BLEND);
      const at = this.use(this.lines, look, shown, 0.003);
      if (shown.elements) this.paintElements(at, visible);
      gl.uniform4f(at.plain, 0.1, 0.1, 0.1, 1);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.sharp);
      for (const { part } of visible) {
        gl.drawElements(gl.LINES, 2 * (part.edges[1] - part.edges[0]), gl.UNSIGNED_INT, 8 * part.edges[0]);
      }
      this.paintDots(this.use(this.dots, look, shown, 0.004), look, shown);
      if (shown.obstacles) this.paintObstacles(this.use(this.lines, look, shown, -0.004), shown);
      gl.disable(gl.BLEND);
    }

    paintFaces(at, visible, shown) {
      const { gl } = this;
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles);
      gl.uniform1f(at.lit, this.lit);
      for (const { part, k } of visible) {
        if (shown.byPart) gl.uniform4f(at.plain, ...PARTS[k % PARTS.length], 1);
        const [from, to] = part.facets.map((f) => this.shape.begin[f]);
        gl.drawElements(gl.TRIANGLES, to - from, gl.UNSIGNED_INT, 4 * from);
      }
    }

    paintElements(at, visible) {
      const { gl } = this;
      gl.uniform4f(at.plain, 0, 0, 0, 0.25);
      for (const { part, k } of visible) {
        if (!this.wires[k]) {
          const ends = wires(this.shape, part, this.shape.count);
          this.wires[k] = { buffer: buffer(gl, gl.ELEMENT_ARRAY_BUFFER, ends), length: ends.length };
        }
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.wires[k].buffer);
        gl.drawElements(gl.LINES, this.wires[k].length, gl.UNSIGNED_INT, 0);
      }
    }

    paintDots(at, look, shown) {
      const { gl } = this;
      const count = shown.dots.reduce((sum, of) => sum + of.vertices.length, 0), room = (0.5 * gl.canvas.clientHeight * look.zoom) / count;
      gl.uniform1f(at.size, Math.max(3.5, Math.min(7, room)) * (window.devicePixelRatio || 1));
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.at);
      // Contact is seen above separation.
      for (const { colour, vertices } of [...shown.dots].reverse()) {
        gl.uniform4f(at.plain, ...colour, 1);
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, vertices, gl.STREAM_DRAW);
        gl.drawElements(gl.POINTS, vertices.length, gl.UNSIGNED_INT, 0);
      }
    }

    // Behind the faces that they touch, so that they do not veil them.
    paintObstacles(at, shown) {
      const { gl } = this;
      gl.bindBuffer(gl.ARRAY_BUFFER, this.obstacles);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
      for (let k = 1; k < 4; k++) gl.disableVertexAttribArray(k);
      gl.uniform4f(at.plain, 0.6, 0.62, 0.65, 0.3);
      gl.depthMask(false);
      gl.drawArrays(gl.TRIANGLES, 0, shown.around);
      gl.depthMask(true);
    }
  }

  // The controls above the view: a line of lists, boxes and a slider.
  class Controls {
    constructor(root) {
      this.bar = element("div", root, { className: "controls" });
    }

    label(text) {
      return element("label", this.bar, { textContent: text + " " });
    }

    choice(text, names, chosen, then) {
      const list = element("select", this.label(text));
      names.forEach((name, k) => element("option", list, { textContent: name, value: k }));
      list.value = chosen;
      list.onchange = () => then(Number(list.value));
    }

    // Its value, as text beside it and for screen readers.
    slider(text, most, value, then) {
      const label = this.label(text);
      const input = element("input", label, { type: "range", min: 0, max: most, value });
      const told = element("span", label, { className: "number" });
      input.oninput = () => then(Number(input.value));
      const tell = (value) => {
        told.textContent = value;
        input.setAttribute("aria-valuetext", value);
      };
      const move = (value) => {
        input.value = value;
        then(value);
      };
      return { value: () => Number(input.value), tell, move };
    }

    box(text, on, then) {
      const label = element("label", this.bar), input = element("input", label, { type: "checkbox", checked: on });
      label.append(" " + text);
      input.onchange = () => then(input.checked);
    }

    button(text, then) {
      const made = element("button", this.bar, { type: "button", textContent: text });
      made.onclick = then;
      return made;
    }
  }

  // A button that moves the slider from step to step, from the first again after the last.
  function play(controls, steps, last) {
    let timer = null;
    const button = controls.button("Play", () => {
      if (timer === null) {
        if (steps.value() === last) steps.move(0);
        timer = setInterval(next, 400);
      } else stop();
      button.textContent = timer === null ? "Play" : "Stop";
    });
    function next() {
      steps.move(steps.value() + 1);
      if (steps.value() === last) stop();
    }
    function stop() {
      clearInterval(timer);
      timer = null;
      button.textContent = "Play";
    }
  }

  // Starts the view; false if WebGL cannot draw it.
  function start(root, data) {
    const stage = element("div", null, { className: "stage" });
    const canvas = element("canvas", stage, { tabIndex: 0 });
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `The deformed bodies. Arrow keys ${data.plane ? "move" : "turn"} them, plus and minus zoom, Enter tells the value in the middle.`);
    const gl = canvas.getContext("webgl", { antialias: true, alpha: false });
    if (!gl || !gl.getExtension("OES_element_index_uint")) return false;
    const shape = surface(data), parts = data.parts, painter = new Painter(gl, data, shape);
    const azimuth = data.plane ? -Math.PI / 2 : Math.atan2(data.back[1], data.back[0]);
    const home = { azimuth, elevation: Math.asin(data.back[2]), zoom: 1 };
    home.extent = extents(shape, data.size, axesOf(home));
    const look = { ...home, pan: [0, 0] };
    const shown = { step: null, field: 0, factor: 1, elements: shape.corners.length / 4 <= 6000, obstacles: true,
      byPart: false, fixed: false, scale: 1, displacement: null, dots: [], around: 0, hidden: parts.map(() => false) };
    const decoded = data.steps.map(() => null), stills = pictures();

    const controls = new Controls(root);
    root.appendChild(stage);
    element("p", root, { className: "note", textContent:
      (data.plane ? "Drag to move" : "Drag to turn, with Shift or the right button to move") + "; the wheel or two fingers zoom. The pointer shows the value under it. With the view in focus: arrow keys, + and −, Enter for the value in the middle." });
    const value = element("p", stage, { className: "value" });
    value.setAttribute("role", "status");
    const overlay = element("canvas", stage, { className: "axes" });
    const legend = element("div", stage, { className: "legend" });
    const last = data.steps.length - 1;
    const steps = last > 0 ? controls.slider("Load step", last, last, toStep) : null;
    if (last > 0) play(controls, steps, last);
    const names = data.steps[0].fields.map((f) => f.name).concat(parts.length > 1 ? ["parts"] : []);
    controls.choice("Colours", names, 0, (k) => {
      shown.byPart = names[k] === "parts";
      if (!shown.byPart) shown.field = k;
      fill();
    });
    const slider = controls.slider("Displacements ×", 200, 100, draw);
    const set = (what) => (on) => {
      what(on);
      draw();
    };
    if (last > 0) {
      controls.box("same colours in all steps", false, (on) => {
        shown.fixed = on;
        fill();
      });
    }
    controls.box("elements", shown.elements, set((on) => (shown.elements = on)));
    if (data.obstacles) controls.box("obstacles", true, set((on) => (shown.obstacles = on)));
    if (parts.length > 1 && parts.length <= 16) {
      parts.forEach((part, k) => controls.box(part.name, true, set((on) => (shown.hidden[k] = !on))));
    }
    controls.button("Reset", set(() => Object.assign(look, home, { pan: [0, 0] })));

    function toStep(k) {
      decoded[k] = decoded[k] || step(data.steps[k]);
      shown.step = k;
      shown.displacement = decoded[k].displacement;
      shown.dots = decoded[k].dots;
      if (steps) steps.tell(data.steps[k].name);
      painter.fill("moved", shown.displacement);
      const around = new Float32Array(bytes(data.steps[k].obstacles || data.obstacles));
      shown.around = around.length / 3;
      painter.fill("obstacles", around);
      stills.show(data.steps[k].name);
      fill();
    }

    // Moves the field to the GPU, and shows the meaning of its colours.
    function fill() {
      const field = decoded[shown.step].fields[shown.field];
      // The scale of colours comes from the step where the field is largest, or from this one.
      const all = data.steps.map((s) => s.fields[shown.field]), most = all.reduce((a, b) => (b.top > a.top ? b : a));
      const scale = shown.fixed ? most : field;
      shown.scale = field.top / scale.top;
      painter.fill("values", field.values);
      if (shown.byPart) nameParts(legend, parts);
      else colourBar(legend, scale, data.colours);
      data.steps[shown.step].dots.forEach((of) => entry(legend, "part dot", of.colour, of.name));
      draw();
    }

    // The value of the field at a point of the stage, by the shape of the triangle there.
    function point(at) {
      const field = decoded[shown.step].fields[shown.field];
      const found = at && painter.pick(look, shown, (2 * at[0]) / stage.clientWidth - 1, 1 - (2 * at[1]) / stage.clientHeight);
      const values = found ? found.vertices.map((i) => field.values[i]) : [];
      if (!found) value.textContent = "";
      else if (shown.byPart) value.textContent = parts[found.part].name;
      else if (Math.min(...values) < -0.5) value.textContent = `${field.name}: none here`;
      else {
        const sum = values.reduce((sum, v, k) => sum + v * found.weights[k], 0);
        value.textContent = `${field.name} ${Number((field.top * sum).toPrecision(4))} ${field.unit}`;
      }
    }

    let waiting = false;
    function draw() {
      if (!waiting) requestAnimationFrame(paint);
      waiting = true;
    }

    function paint() {
      waiting = false;
      const ratio = window.devicePixelRatio || 1;
      canvas.width = overlay.width = Math.round(stage.clientWidth * ratio);
      canvas.height = overlay.height = Math.round(stage.clientHeight * ratio);
      shown.factor = (slider.value() / 100) * decoded[shown.step].magnified;
      slider.tell(Number(shown.factor.toPrecision(3)));
      painter.paint(look, shown);
      triad(overlay, axesOf(look), data.plane ? [0, 1] : [0, 1, 2], ratio);
    }

    function turn(right, down) {
      if (data.plane) return shift(100 * right, 100 * down);
      look.azimuth -= right;
      look.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, look.elevation + down));
      draw();
    }
    function shift(right, down) {
      look.pan = [look.pan[0] + (2 * right) / stage.clientWidth, look.pan[1] - (2 * down) / stage.clientHeight];
      draw();
    }
    // About a point of the stage.
    function zoom(by, x, y) {
      const before = look.zoom;
      look.zoom = Math.max(0.3, Math.min(60, look.zoom * by));
      const at = [(2 * x) / stage.clientWidth - 1, 1 - (2 * y) / stage.clientHeight];
      look.pan = look.pan.map((v, c) => at[c] + (v - at[c]) * (look.zoom / before));
      draw();
    }
    listen(canvas, turn, shift, zoom, point);
    // Paper has the still picture, which shows the last step.
    window.addEventListener("beforeprint", () => {
      still(true);
      stills.show(data.steps[last].name);
    });
    window.addEventListener("afterprint", () => {
      still(false);
      stills.show(data.steps[shown.step].name);
    });
    // The GPU may be taken away: the still picture is there again.
    canvas.addEventListener("webglcontextlost", () => {
      root.hidden = true;
      still(true);
    });
    window.addEventListener("resize", draw);
    root.hidden = false;
    toStep(last);
    return true;
  }

  // The pictures of contacts of all steps. `show` puts those of a step where those of the last one are.
  function pictures() {
    const of = {}, figures = [...document.querySelectorAll("figure[data-of]")];
    for (const figure of figures) {
      const { of: name, step } = figure.dataset, here = (of[name] = of[name] || { frame: figure, pictures: {} });
      here.pictures[step] = [...figure.childNodes];
    }
    document.querySelectorAll("details.earlier").forEach((details) => details.remove());
    return { show: (step) => Object.values(of).forEach(({ frame, pictures }) => {
      if (pictures[step]) frame.replaceChildren(...pictures[step]);
    }) };
  }

  function still(open) {
    const picture = document.getElementById("still");
    if (picture) picture.open = open;
  }

  const root = document.getElementById("bodies");
  try {
    if (start(root, JSON.parse(document.getElementById("bodies-data").textContent))) still(false);
  } catch (error) {
    root.hidden = true;
    console.warn(error);
  }
})();
