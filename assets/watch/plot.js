// Error against seconds, both logarithmic: one line an edit, the newest in front.

const COLOURS = ["#e07b00", "#3b82c4", "#7a9a3a", "#a05ab0", "#888888"];
const SHOWN = COLOURS.length;

export class Plot {
  constructor(canvas, key) {
    this.canvas = canvas;
    this.key = key;
    this.series = [];
    /** What was under way when A was frozen; it stays. */
    this.before = null;
  }

  freeze() {
    this.before = this.series.at(-1) ?? null;
    this.draw();
  }

  /** A new line where rendering has started anew; `label` says what of the view is not as usual. */
  add(frame, label) {
    if (frame.moving || !(frame.error > 0) || !(frame.seconds > 0)) return;
    let last = this.series.at(-1);
    if (!last || last.start !== frame.start || last.edit !== frame.edit) {
      last = { edit: frame.edit, start: frame.start, label, points: [] };
      const older = this.series.filter((s) => s.points.length > 1);
      const [before, others] = [older.filter((s) => s === this.before), older.filter((s) => s !== this.before)];
      this.series = [...before, ...others.slice(1 + before.length - SHOWN), last];
    }
    last.points.push([frame.seconds, frame.error]);
    this.draw();
  }

  draw() {
    const { canvas } = this;
    const ratio = devicePixelRatio;
    const [width, height] = [canvas.clientWidth || 300, 170];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    canvas.style.height = `${height}px`;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const points = this.series.flatMap((s) => s.points);
    if (points.length === 0) return;
    const range = (i) => {
      const logs = points.map((p) => Math.log10(p[i]));
      const low = Math.floor(Math.min(...logs) * 2) / 2;
      return [low, Math.max(Math.ceil(Math.max(...logs) * 2) / 2, low + 0.5)];
    };
    const [[x0, x1], [y0, y1]] = [range(0), range(1)];
    const box = { left: 42, right: width - 8, top: 6, bottom: height - 20 };
    const px = (s) => box.left + ((Math.log10(s) - x0) / (x1 - x0)) * (box.right - box.left);
    const py = (e) => box.bottom - ((Math.log10(e) - y0) / (y1 - y0)) * (box.bottom - box.top);
    const style = getComputedStyle(canvas);
    context.font = "11px system-ui, sans-serif";
    context.fillStyle = style.color;
    context.strokeStyle = style.color;
    this.axis(context, x0, x1, (v) => `${number(v)} s`, (v, text) => {
      context.textAlign = "center";
      context.fillText(text, Math.min(px(v), box.right - 12), height - 6);
      line(context, px(v), box.top, px(v), box.bottom);
    });
    this.axis(context, y0, y1, (v) => `${number(100 * v)} %`, (v, text) => {
      context.textAlign = "right";
      context.fillText(text, box.left - 4, py(v) + 4);
      line(context, box.left, py(v), box.right, py(v));
    });
    this.series.forEach((series, i) => {
      context.strokeStyle = COLOURS[this.series.length - 1 - i];
      context.globalAlpha = 1;
      context.lineWidth = i === this.series.length - 1 ? 2 : 1.2;
      context.beginPath();
      for (const [s, e] of series.points) context.lineTo(px(s), py(e));
      context.setLineDash(series === this.before ? [5, 3] : []);
      context.stroke();
    });
    context.setLineDash([]);
    this.key.replaceChildren(...this.series.map((series, i) => {
      const entry = document.createElement("span");
      entry.style.color = COLOURS[this.series.length - 1 - i];
      const names = [series === this.before && "A", i === this.series.length - 1 && "now"].filter(Boolean);
      const edit = [`edit ${series.edit}`, series.label].filter(Boolean).join(" ");
      entry.textContent = names.length > 0 ? `${names.join(", ")} (${edit})` : edit;
      return entry;
    }));
  }

  axis(context, low, high, name, tick) {
    context.globalAlpha = 1;
    const step = high - low > 2 ? 1 : 0.5;
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) tick(10 ** v, name(10 ** v));
  }
}

function line(context, x0, y0, x1, y1) {
  context.globalAlpha = 0.2;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
  context.globalAlpha = 1;
}

function number(value) {
  return Number(value.toPrecision(value < 1 ? 1 : 2)).toString();
}
