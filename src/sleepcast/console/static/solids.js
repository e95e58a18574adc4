// What stands and flies in the view in three dimensions, as meshes of three.js: ground, walls, robots, their shadows and
// trails. All of it is flat colour with the shade of its form, which software draws fast; there are no lamps.

import { copter, disc, farCopter, farRover, prisms, rover } from "./forms.js";

const NEAR_FORMS = 2000; // robots that have all of their form, and shadows; more are a few triangles each
const SHADOW = 0.28; // opacity
const ABOVE = 0.002; // of the distance to the eye: what lies on the ground is drawn so far above it

export class Solids {
  // three: the module three.js. canvas: to be drawn on. Throws where the browser has no WebGL.
  constructor(three, canvas) {
    this.three = three;
    three.ColorManagement.enabled = false; // colours are the page's, as they are
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" });
    this.renderer.outputColorSpace = three.LinearSRGBColorSpace;
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera();
    this.camera.up.set(0, 0, 1);
    this.paint = new three.MeshBasicMaterial({ vertexColors: true, side: three.DoubleSide });
    this.dark = new three.MeshBasicMaterial({ color: 0, transparent: true, opacity: SHADOW, depthWrite: false });
    this.lines = new three.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false });
    this.ground = this.walls = this.bodies = this.shadows = this.trails = null;
    this.kind = ""; // of the bodies that there are
  }

  resize(width, height, ratio) {
    this.renderer.setPixelRatio(ratio);
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

  geometry({ corners, shades }, [red, green, blue] = [1, 1, 1]) {
    const { BufferAttribute, BufferGeometry } = this.three;
    const colours = new Float32Array(corners.length);
    shades.forEach((shade, corner) => colours.set([shade * red, shade * green, shade * blue], 3 * corner));
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(corners, 3));
    made.setAttribute("color", new BufferAttribute(colours, 3));
    return made;
  }

  // ---- what stays

  // sheet: the canvas that lies on the area. sky: a colour.
  setGround([left, bottom, right, top], sheet, sky) {
    const { CanvasTexture, Mesh, MeshBasicMaterial, PlaneGeometry } = this.three;
    this.scene.background = new this.three.Color(sky);
    this.ground?.material.map.dispose();
    this.ground?.material.dispose();
    const map = Object.assign(new CanvasTexture(sheet), { anisotropy: 4 });
    const mesh = new Mesh(new PlaneGeometry(right - left, top - bottom), new MeshBasicMaterial({ map, depthWrite: false }));
    mesh.position.set((left + right) / 2, (bottom + top) / 2, 0);
    mesh.renderOrder = -2;
    this.put("ground", mesh);
  }

  setWalls(obstacles, high, colour) {
    const { Color, Mesh, ShapeUtils, Vector2 } = this.three;
    const points = (outline) => outline.map(([x, y]) => new Vector2(x, y));
    const form = prisms(obstacles, high, (contour, holes) => ShapeUtils.triangulateShape(points(contour), holes.map(points)));
    this.put("walls", form.corners.length ? new Mesh(this.geometry(form, new Color(colour).toArray()), this.paint) : null);
  }

  // ---- what moves

  // robots: {count, poses, heights, sizes: gives the radius to draw of each, m; colours: [red, green, blue] by look; looks: of each}
  setBodies(robots) {
    const { count, heights } = robots;
    const kind = `${count} ${heights !== null}`;
    if (kind !== this.kind) this.renew(count, heights !== null);
    this.kind = kind;
    const matrices = this.bodies.instanceMatrix.array;
    const shadows = this.shadows?.instanceMatrix.array;
    for (let i = 0; i < count; i += 1) {
      const [x, y, heading, z, size] = [robots.poses[3 * i], robots.poses[3 * i + 1], robots.poses[3 * i + 2] || 0, heights?.[i] ?? 0, robots.sizes(i)];
      place(matrices, i, x, y, z, heading, size);
      if (shadows) place(shadows, i, x, y, ABOVE * size, 0, z > size ? 0.8 * size : 0);
      this.bodies.instanceColor.array.set(robots.colours[robots.looks[i]], 3 * i);
    }
    this.bodies.instanceMatrix.needsUpdate = this.bodies.instanceColor.needsUpdate = true;
    if (shadows) this.shadows.instanceMatrix.needsUpdate = true;
  }

  renew(count, fly) {
    const { InstancedBufferAttribute, InstancedMesh } = this.three;
    const near = count < NEAR_FORMS;
    const make = fly ? (near ? copter : farCopter) : near ? rover : farRover;
    const bodies = new InstancedMesh(this.geometry(make()), this.paint, count);
    bodies.instanceColor = new InstancedBufferAttribute(new Float32Array(3 * count), 3);
    this.put("bodies", bodies);
    this.put("shadows", fly && near ? Object.assign(new InstancedMesh(this.geometry(disc()), this.dark, count), { renderOrder: -1 }) : null);
  }

  // corners: x, y, z of both ends of each line in turn. colours: red, green, blue and opacity of each end.
  setTrails(corners, colours) {
    const { BufferAttribute, BufferGeometry, LineSegments } = this.three;
    const made = new BufferGeometry();
    made.setAttribute("position", new BufferAttribute(corners, 3));
    made.setAttribute("color", new BufferAttribute(colours, 4));
    this.put("trails", corners.length ? new LineSegments(made, this.lines) : null);
  }

  // Draw all, as an orbit sees it.
  render(orbit) {
    const { camera } = this;
    camera.fov = (orbit.field * 180) / Math.PI;
    camera.near = orbit.distance / 200;
    camera.far = orbit.distance + 40 * orbit.whole;
    camera.updateProjectionMatrix();
    camera.position.set(...orbit.eye);
    camera.lookAt(...orbit.target);
    this.renderer.render(this.scene, camera);
  }
}

// Where a body of this size stands, as the columns of its matrix.
function place(matrices, i, x, y, z, heading, size) {
  const [c, s] = [size * Math.cos(heading), size * Math.sin(heading)];
  const at = 16 * i;
  matrices[at] = matrices[at + 5] = c;
  matrices[at + 1] = s;
  matrices[at + 4] = -s;
  matrices[at + 10] = size;
  matrices[at + 12] = x;
  matrices[at + 13] = y;
  matrices[at + 14] = z;
  matrices[at + 15] = 1;
}
