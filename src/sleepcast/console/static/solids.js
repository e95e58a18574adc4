// What stands and flies in the view in three dimensions, as meshes of three.js: ground, walls, robots, their shadows and
// trails. All of it is flat colour with the shade of its form, which software draws fast; there are no lamps.

import { copter, cross, disc, farCopter, farDisc, farPlane, farRover, plane, prisms, rover } from "./forms.js";
import { Herd } from "./herd.js";
import { groundAt } from "./groundmap.js";
import { Orbit } from "./orbit.js";

const FORMS = { copter: [copter, farCopter], plane: [plane, farPlane], rover: [rover, farRover] }; // near and far
const SHADOWS = 2000; // robots; more have none, and only a few triangles each
const ALL_FORMS = 300; // robots that have all of their form however small they are,
const SEEN = 7; // pixels: half the length at which others have it
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i; // what draws where there is no graphics card
const ABOVE = 0.002; // of the distance to the eye: what lies on the ground is drawn so far above it
const LAID = {
  vertexShader: "varying vec2 at; void main() { at = vec2(uv.x, 1.0 - uv.y); gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
  fragmentShader: "uniform sampler2D map; varying vec2 at; void main() { gl_FragColor = texture2D(map, at); }",
}; // a picture, whose rows begin at the top, and nothing else: it fills the canvas, and each step more is one for a million pixels

// Which robots have which form: {members: how many of each form, by name; forms: the name of each robot's; places: of each robot
// among those of its form}. told: names of forms in the order of the robots, each with how many have it; the others have `usual`.
export function membersOf(count, told, usual) {
  const forms = told.flatMap(([robots, form]) => Array(robots).fill(form in FORMS ? form : usual)).slice(0, count);
  forms.push(...Array(count - forms.length).fill(usual));
  const members = {};
  const places = Uint32Array.from(forms, (form) => (members[form] = (members[form] ?? 0) + 1) - 1);
  return { members, forms, places };
}

export class Solids {
  // three: the module three.js. canvas: an OffscreenCanvas to draw on. Throws where the browser has no WebGL.
  constructor(three, canvas) {
    this.three = three;
    three.ColorManagement.enabled = false; // colours are the page's, as they are
    const context = contextOf(canvas);
    this.software = !context.getContextAttributes().antialias;
    this.canvas = canvas;
    this.renderer = new three.WebGLRenderer({ canvas, context });
    [this.ratio, this.part] = [1, 1]; // pixels of the screen for one of the page, and how many of these are drawn
    this.renderer.outputColorSpace = three.LinearSRGBColorSpace;
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    this.paint = new three.MeshBasicMaterial({ vertexColors: true, side: three.DoubleSide });
    this.closed = new three.MeshBasicMaterial({ vertexColors: true }); // for forms that have no seen inner side
    this.dark = new three.MeshBasicMaterial({ color: 0, transparent: true, depthWrite: false });
    this.lines = new three.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false });
    this.ground = this.walls = this.shadows = this.trails = null;
    this.herds = null; // what moves bodies and shadows: {bodies: by form, shadows, forms, places}
    this.crosses = null; // what moves those over crashed bodies: {herd, room}
    this.kind = ""; // of the bodies that there are
    this.orbit = new Orbit(); // from where it is seen
  }

  resize(width, height, ratio) {
    this.ratio = ratio;
    this.renderer.setPixelRatio(this.part * ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
  }

  // Put a mesh in place of the one of this name, whose memory is given back.
  put(name, mesh) {
    const before = this[name];
    if (before) {
      this.scene.remove(before);
      before.geometry.dispose();
      before.dispose?.();
    }
    this[name] = mesh;
    if (!mesh) return;
    mesh.frustumCulled = false;
    this.scene.add(mesh);
  }

  geometry({ corners, shades, triangles }, [red, green, blue] = [1, 1, 1]) {
    const { BufferAttribute, BufferGeometry } = this.three;
    const colours = new Float32Array(corners.length);
    shades.forEach((shade, corner) => colours.set([shade * red, shade * green, shade * blue], 3 * corner));
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(corners, 3));
    made.setAttribute("color", new BufferAttribute(colours, 3));
    made.setIndex(triangles);
    return made;
  }

  // ---- what stays

  // sheet: a picture of the area, of up to 16 MB, which is closed as soon as it is drawn. sky: a colour. relief: how high the area
  // is, as of groundmap.js.
  setGround(area, sheet, sky, relief) {
    const [left, bottom, right, top] = area;
    this.groundAt = (x, y) => groundAt(area, relief, x, y);
    const { CanvasTexture, Mesh, PlaneGeometry, ShaderMaterial } = this.three;
    this.scene.background = new this.three.Color(sky);
    this.ground?.material.uniforms.map.value.dispose();
    this.ground?.material.dispose();
    const map = Object.assign(new CanvasTexture(sheet), { minFilter: this.three.LinearMipmapNearestFilter, onUpdate: () => sheet.close() });
    const material = new ShaderMaterial({ uniforms: { map: { value: map } }, ...LAID, depthWrite: Boolean(relief) }); // what lies behind hills is hidden
    const { columns = 2, rows = 2, heights } = relief ?? {};
    const mesh = new Mesh(new PlaneGeometry(right - left, top - bottom, columns - 1, rows - 1), material);
    if (heights) lift(mesh.geometry.attributes.position, columns, rows, heights);
    mesh.position.set((left + right) / 2, (bottom + top) / 2, 0);
    mesh.renderOrder = -2;
    this.put("ground", mesh);
  }

  // tall: how high each is, m.
  setWalls(obstacles, tall, colour) {
    const { Color, Mesh, ShapeUtils, Vector2 } = this.three;
    const points = (outline) => outline.map(([x, y]) => new Vector2(x, y));
    const form = prisms(obstacles, (index) => tall[index], (contour, holes) => ShapeUtils.triangulateShape(points(contour), holes.map(points)));
    this.put("walls", form.corners.length ? new Mesh(this.geometry(form, new Color(colour).toArray()), this.paint) : null);
  }

  // opacity: of 1; on dark ground a shadow has to be darker to be seen.
  setShadow(opacity) {
    this.dark.opacity = opacity;
  }

  // inks: colours of robots by their look; bad: that of crosses; each [red, green, blue] of 1.
  setInks(inks, bad) {
    Object.assign(this, { inks, bad });
  }

  // values: of an Orbit that sees what is drawn from now on.
  look(values) {
    const { camera } = this;
    const orbit = (this.orbit = Orbit.of(values));
    camera.fov = (orbit.field * 180) / Math.PI;
    camera.near = orbit.distance / 200;
    camera.far = orbit.distance + 40 * orbit.whole;
    camera.updateProjectionMatrix();
    camera.position.set(...orbit.eye);
    camera.lookAt(...orbit.target);
  }

  // ---- what moves

  // robots: {count, poses, heights, sizes: how many have which radius, m, in their order; least: pixels that half of each has at
  // least; forms: as told to `membersOf`; looks: of each; crashed: whether each has}
  setBodies(robots) {
    const { orbit } = this;
    const { count, poses, heights } = robots;
    const mean = robots.sizes.reduce((sum, [some, radius]) => sum + some * radius, 0) / Math.max(1, count);
    const near = count <= ALL_FORMS || (count < SHADOWS && (mean * orbit.focus) / orbit.distance >= SEEN);
    const kind = [count, heights !== null, near, robots.forms].join();
    if (kind !== this.kind) this.renew(robots, near);
    this.kind = kind;
    const { bodies, shadows, forms, places } = this.herds;
    const depths = new Float32Array(count);
    orbit.project(poses, heights, new Float32Array(3 * count), depths);
    const sizes = orbit.lengths(robots.sizes, robots.least, depths);
    for (let i = 0; i < count; i += 1) {
      const [x, y, heading, z, size] = [poses[3 * i], poses[3 * i + 1], poses[3 * i + 2] || 0, heights?.[i] ?? 0, sizes[i]];
      bodies[forms[i]].place(places[i], x, y, z, heading, size);
      bodies[forms[i]].dye(places[i], this.inks[robots.looks[i]]);
      const ground = shadows ? this.groundAt(x, y) : 0;
      shadows?.place(i, x, y, ground + ABOVE * size, 0, z - ground > size ? 0.8 * size : 0);
    }
    for (const form in bodies) bodies[form].changed();
    shadows?.changed();
    this.setCrosses(robots, sizes);
  }

  // Mark who has crashed. sizes: half of each robot's length as it is drawn, m.
  setCrosses({ poses, heights, crashed }, sizes) {
    const who = [...crashed.keys()].filter((i) => crashed[i]);
    const room = this.crosses?.room ?? 0;
    if (who.length > room || (room && !who.length)) this.renewCrosses(2 * who.length);
    if (!this.crosses) return;
    for (let at = 0; at < this.crosses.room; at += 1) {
      const i = who[at] ?? -1; // NaN where there is no more
      this.crosses.herd.place(at, poses[3 * i] ?? NaN, poses[3 * i + 1], heights?.[i] ?? 0, 0, sizes[i]);
      this.crosses.herd.dye(at, this.bad);
    }
    this.crosses.herd.changed();
  }

  renewCrosses(room) {
    this.crosses = room ? { room, herd: new Herd(this.three, cross(), this.paint, room) } : null;
    this.put("cross", this.crosses?.herd.mesh ?? null);
  }

  renew({ count, heights, forms: told }, near) {
    const fly = heights !== null;
    const { members, forms, places } = membersOf(count, told, fly ? "copter" : "rover");
    const bodies = {};
    for (const [form, makes] of Object.entries(FORMS)) {
      const material = form !== "rover" && near ? this.paint : this.closed;
      if (members[form]) bodies[form] = new Herd(this.three, makes[near ? 0 : 1](), material, members[form]);
      this.put(`bodies ${form}`, bodies[form]?.mesh ?? null);
    }
    const shadows = fly && count < SHADOWS ? new Herd(this.three, near ? disc() : farDisc(), this.dark, count) : null;
    this.put("shadows", shadows && Object.assign(shadows.mesh, { renderOrder: -1 }));
    this.herds = { bodies, shadows, forms, places };
  }

  // corners: x, y, z of both ends of each line in turn. colours: red, green, blue and opacity of each end.
  setTrails(corners, colours) {
    if (!this.trails || this.trails.room < corners.length) this.put("trails", this.roomForTrails(2 * corners.length));
    const { position, color } = this.trails.geometry.attributes;
    position.array.set(corners);
    color.array.set(colours);
    position.needsUpdate = color.needsUpdate = true;
    this.trails.geometry.setDrawRange(0, corners.length / 3);
  }

  roomForTrails(room) {
    const { BufferAttribute, BufferGeometry, LineSegments } = this.three;
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(new Float32Array(room), 3));
    made.setAttribute("color", new BufferAttribute(new Float32Array((4 * room) / 3), 4));
    return Object.assign(new LineSegments(made, this.lines), { room });
  }

  // Draw all, and give the picture, null if the browser has taken the graphics away. part: of the pixels of each side.
  render(part) {
    if (part !== this.part) this.renderer.setPixelRatio(part * this.ratio);
    this.part = part;
    this.renderer.render(this.scene, this.camera);
    if (this.software) this.finish();
    return this.renderer.getContext().isContextLost() ? null : this.canvas.transferToImageBitmap();
  }

  // Wait here until it is drawn: whoever takes the picture would wait else.
  finish() {
    const gl = this.renderer.getContext();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }
}

// Put the corners of a level sheet, the top row first, at these heights, the bottom row first.
function lift(corners, columns, rows, heights) {
  for (let row = 0; row < rows; row += 1) {
    for (let column = 0; column < columns; column += 1) corners.setZ(row * columns + column, heights[(rows - 1 - row) * columns + column]);
  }
}

// What the canvas is drawn with. Edges are smooth where a graphics card does it: software would take twice as long. Throws where
// there is no WebGL.
function contextOf(canvas) {
  const probe = new OffscreenCanvas(1, 1).getContext("webgl2");
  if (!probe) throw new Error("the browser has no WebGL");
  const about = probe.getExtension("WEBGL_debug_renderer_info");
  const drawnBy = probe.getParameter(about ? about.UNMASKED_RENDERER_WEBGL : probe.RENDERER);
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return canvas.getContext("webgl2", { alpha: false, antialias: !SOFTWARE.test(drawnBy), powerPreference: "low-power" });
}

