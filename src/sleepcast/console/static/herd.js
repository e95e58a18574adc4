// Many bodies of one form as one mesh of three.js. Each corner is moved here, not by the renderer: an InstancedMesh costs
// software 20 us for each robot, whatever its form, and this costs less than one.

export class Herd {
  // form: as of forms.js. material: what it is drawn with.
  constructor(three, form, material, count) {
    const { BufferAttribute, BufferGeometry, Mesh } = three;
    const size = form.shades.length;
    const dynamic = (array, item, normalized = false) => new BufferAttribute(array, item, normalized).setUsage(three.DynamicDrawUsage);
    this.form = form;
    this.positions = new Float32Array(3 * size * count);
    this.colours = new Uint8Array(4 * size * count).fill(255);
    this.dyed = new Array(count).fill(null); // with which colour each body is
    const indices = new Uint32Array(form.triangles.length * count);
    for (let at = 0; at < indices.length; at += 1) {
      indices[at] = form.triangles[at % form.triangles.length] + size * Math.floor(at / form.triangles.length);
    }
    const geometry = new BufferGeometry();
    geometry.setIndex(new BufferAttribute(indices, 1));
    geometry.setAttribute("position", dynamic(this.positions, 3));
    geometry.setAttribute("color", dynamic(this.colours, 4, true));
    this.mesh = new Mesh(geometry, material);
  }

  // Put a body there: m, rad counter-clockwise from x, and its radius in m. NaN: nobody is there, and nothing is to be seen.
  place(i, x, y, z, heading, radius) {
    const { positions, form: { corners } } = this;
    if (Number.isNaN(x)) {
      positions.fill(0, i * corners.length, (i + 1) * corners.length);
      return;
    }
    const [c, s] = [radius * Math.cos(heading), radius * Math.sin(heading)];
    for (let from = 0, to = i * corners.length; from < corners.length; from += 3, to += 3) {
      positions[to] = x + c * corners[from] - s * corners[from + 1];
      positions[to + 1] = y + s * corners[from] + c * corners[from + 1];
      positions[to + 2] = z + radius * corners[from + 2];
    }
  }

  // Give a body a colour: red, green and blue of 1. The same one is the same array.
  dye(i, colour) {
    if (this.dyed[i] === colour) return;
    this.dyed[i] = colour;
    const { colours, form: { shades } } = this;
    shades.forEach((shade, corner) => {
      for (let part = 0; part < 3; part += 1) colours[4 * (i * shades.length + corner) + part] = 255 * shade * colour[part];
    });
    this.mesh.geometry.attributes.color.needsUpdate = true;
  }

  // All are where they are to be.
  changed() {
    this.mesh.geometry.attributes.position.needsUpdate = true;
  }
}
