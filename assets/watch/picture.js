// The image: what came last (B), what was frozen (A), and what of the two is shown.

export class Picture {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d", { willReadFrequently: true });
    this.now = null;
    this.frozen = null;
    this.mode = "b";
    this.wipe = 0.5;
    this.size = [1, 1];
    this.zoom = 0;
  }

  /** `full` is the size of the whole image: one of a moving camera has fewer pixels and is stretched. */
  show(bitmap, full) {
    this.now?.close();
    this.now = bitmap;
    this.resize(full);
    this.draw();
  }

  async freeze() {
    if (this.now) this.frozen = await createImageBitmap(this.now);
  }

  resize([width, height]) {
    this.size = [width, height];
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.fit();
  }

  /** Size on the page: whole numbers of device pixels a pixel, or as large as there is room. */
  fit() {
    const [width, height] = this.size;
    const room = this.canvas.closest("#scroller");
    const fitting = Math.min(room.clientWidth / width, room.clientHeight / height);
    const scale = this.zoom > 0 ? this.zoom / devicePixelRatio : fitting;
    this.canvas.style.width = `${width * scale}px`;
    this.canvas.style.height = `${height * scale}px`;
    this.canvas.classList.toggle("pixels", scale * devicePixelRatio >= 2);
    this.scale = scale;
  }

  draw() {
    const [width, height] = this.size;
    const { context, frozen } = this;
    if (!this.now) return;
    const whole = (bitmap) => context.drawImage(bitmap, 0, 0, width, height);
    const mode = frozen ? this.mode : "b";
    if (mode === "a") return whole(frozen);
    whole(this.now);
    if (mode === "wipe") {
      const edge = Math.round(this.wipe * width);
      if (edge > 0) {
        const share = frozen.width / width;
        context.drawImage(frozen, 0, 0, edge * share, frozen.height, 0, 0, edge, height);
      }
      context.fillStyle = "#fff";
      context.fillRect(edge, 0, 1, height);
    } else if (mode === "difference" || mode === "heat") {
      this.drawDifference(mode === "heat");
    }
  }

  drawDifference(isHeat) {
    const [width, height] = this.size;
    const b = this.context.getImageData(0, 0, width, height);
    this.context.drawImage(this.frozen, 0, 0, width, height);
    const a = this.context.getImageData(0, 0, width, height).data;
    const out = b.data;
    for (let i = 0; i < out.length; i += 4) {
      const d = [0, 1, 2].map((c) => Math.abs(out[i + c] - a[i + c]));
      const colour = isHeat ? heat((d[0] + d[1] + d[2]) / 3 / 64) : d.map((x) => 4 * x);
      [out[i], out[i + 1], out[i + 2]] = colour;
    }
    this.context.putImageData(b, 0, 0);
  }

  /** The pixel under a place in the window. */
  pixelAt(clientX, clientY) {
    const box = this.canvas.getBoundingClientRect();
    const x = Math.floor((clientX - box.left) / this.scale);
    const y = Math.floor((clientY - box.top) / this.scale);
    const inside = x >= 0 && y >= 0 && x < this.size[0] && y < this.size[1];
    return inside ? [x, y] : null;
  }
}

// Black, blue, red, yellow, white: darker is always less.
const STOPS = [[0, 0, 0], [40, 30, 150], [200, 40, 60], [250, 200, 50], [255, 255, 255]];

function heat(value) {
  const at = Math.min(Math.max(value, 0), 1) * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  return STOPS[low].map((c, i) => c + (at - low) * (STOPS[low + 1][i] - c));
}
