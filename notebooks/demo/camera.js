// A drawing of what the camera sees, ray by ray, from the room as data. For the eye alone: the robot of this page
// learns from the stored histograms of the simulator's own pictures.

class Camera {
  // room: as homing_lib.publish.demo writes it; texels: Uint8Array, one square texture of `side` after the other.
  constructor(room, texels, side, settings) {
    Object.assign(this, { room, texels, side });
    this.height = settings.camera_height_m;
    this.offset = settings.camera_offset_m;
    this.slope = Math.tan(radians(settings.field_of_view_deg) / 2);
  }

  // RGBA of a square picture.
  picture(pose, size) {
    const pixels = new Uint8ClampedArray(4 * size * size).fill(255);
    const [fx, fy] = [Math.cos(pose.heading), Math.sin(pose.heading)];
    const eye = [pose.x + this.offset * fx, pose.y + this.offset * fy, this.height];
    for (let row = 0; row < size; row++) {
      const up = this.slope * (1 - (2 * row + 1) / size);
      for (let column = 0; column < size; column++) {
        const right = this.slope * ((2 * column + 1) / size - 1);
        const hit = this.nearest(eye, [fx + right * fy, fy - right * fx, up]);
        if (hit) this.paint(pixels, 4 * (row * size + column), hit);
      }
    }
    return pixels;
  }

  paint(pixels, at, [, texture, u, v]) {
    const last = this.side - 1;
    const column = Math.min(last, Math.max(0, Math.floor(u * this.side)));
    const row = Math.min(last, Math.max(0, Math.floor((1 - v) * this.side)));
    const from = 3 * ((texture * this.side + row) * this.side + column);
    for (let channel = 0; channel < 3; channel++) pixels[at + channel] = this.texels[from + channel];
  }

  // What a ray meets first: [distance, texture, u, v], or null for nothing, above the walls.
  nearest(eye, ray) {
    let hit = this.shell(eye, ray);
    for (const thing of this.room.objects) {
      const other = this[thing.kind](thing, eye, ray);
      if (other && (!hit || other[0] < hit[0])) hit = other;
    }
    return hit;
  }

  // Floor, walls and the pictures on them.
  shell([x, y, z], [dx, dy, dz]) {
    const { size: [width, depth], wallHeight, walls, floor, pictures } = this.room;
    const along = dx > 0 ? (width - x) / dx : -x / dx;
    const across = dy > 0 ? (depth - y) / dy : -y / dy;
    const distance = Math.min(along, across);
    const height = z + distance * dz;
    if (height < 0) {
      const down = -z / dz;
      return [down, floor, (x + down * dx) / width, (y + down * dy) / depth];
    }
    if (height > wallHeight) return null;
    const wall = along < across ? (dx > 0 ? "east" : "west") : dy > 0 ? "north" : "south";
    const place = along < across ? y + distance * dy : x + distance * dx;
    const length = along < across ? depth : width;
    const turned = wall === "east" || wall === "south";
    for (const picture of pictures) {
      const u = 0.5 + ((turned ? -1 : 1) * (place - picture.along)) / picture.size[0];
      const v = 0.5 + (height - picture.height) / picture.size[1];
      if (picture.wall === wall && u >= 0 && u <= 1 && v >= 0 && v <= 1) return [distance, picture.texture, u, v];
    }
    return [distance, walls[wall], (turned ? length - place : place) / length, height / wallHeight];
  }

  Box({ x, y, size: [length, width, height], texture, front }, eye, ray) {
    const low = [x - length / 2, y - width / 2, 0], high = [x + length / 2, y + width / 2, height];
    let enter = 0, leave = Infinity, side = -1;
    for (let axis = 0; axis < 3; axis++) {
      const a = (low[axis] - eye[axis]) / ray[axis], b = (high[axis] - eye[axis]) / ray[axis];
      if (Math.min(a, b) > enter) [enter, side] = [Math.min(a, b), axis];
      leave = Math.min(leave, Math.max(a, b));
    }
    if (side < 0 || enter > leave) return null;
    const share = [0, 1, 2].map((axis) => (eye[axis] + enter * ray[axis] - low[axis]) / (high[axis] - low[axis]));
    if (side === 2) return [enter, texture, share[0], share[1]];
    if (side === 1) return [enter, texture, ray[1] > 0 ? share[0] : 1 - share[0], share[2]];
    return ray[0] > 0 ? [enter, front, 1 - share[1], share[2]] : [enter, texture, share[1], share[2]];
  }

  Cone({ x, y, radius, height, texture }, [ex, ey, ez], [dx, dy, dz]) {
    const [px, py, steep] = [ex - x, ey - y, (radius / height) ** 2];
    const above = height - ez;
    const a = dx * dx + dy * dy - steep * dz * dz;
    const b = px * dx + py * dy + steep * above * dz;
    const c = px * px + py * py - steep * above * above;
    const t = (-b - Math.sqrt(b * b - a * c)) / a;
    const z = ez + t * dz;
    if (!(t > 0 && z >= 0 && z <= height)) return null;
    return [t, texture, Math.atan2(py + t * dy, px + t * dx) / (2 * Math.PI) + 0.5, z / height];
  }

  Ball({ x, y, radius, texture }, [ex, ey, ez], [dx, dy, dz]) {
    const p = [ex - x, ey - y, ez - radius];
    const a = dx * dx + dy * dy + dz * dz;
    const b = p[0] * dx + p[1] * dy + p[2] * dz;
    const t = (-b - Math.sqrt(b * b - a * (p[0] ** 2 + p[1] ** 2 + p[2] ** 2 - radius ** 2))) / a;
    if (!(t > 0)) return null;
    const down = Math.acos(Math.min(1, Math.max(-1, (p[2] + t * dz) / radius)));
    return [t, texture, Math.atan2(p[1] + t * dy, p[0] + t * dx) / (2 * Math.PI) + 0.5, down / Math.PI];
  }
}
