// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The map of a mission on a canvas. The server sends steps once, then which of them is shown.

// Okabe and Ito, without those that are the map's blue or too pale for a thin line.
const COLOURS = ["#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C564B", "#7F7F7F"];
const DASHES = [[], [6, 3], [2, 2]];
const THEMES = {
  light: { sea: "#ffffff", line: "#00000018", ink: "#14171a", halo: "#ffffffcc", edge: "#6b7280" },
  dark: { sea: "#0d1117", line: "#ffffff16", ink: "#f3f4f6", halo: "#0d1117cc", edge: "#9ca3af" },
};
const FLYING = 0, FINDER = 1, LOST = 3, OUT_OF_TIME = 4;
const STATE = 7, FOUND = 16;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export default {
  template: `
    <canvas ref="canvas" class="mission-map" tabindex="0" role="application"
      aria-roledescription="map" :aria-label="label"
      @pointermove="onPointer" @pointerdown="onPointer" @pointerleave="point(null)"
      @keydown="onKey" @blur="point(null)"></canvas>`,
  props: { label: String },
  mounted() {
    this.frame = { grid: 0, names: [], vehicles: [] };
    this.rows = [];
    this.past = null;
    this.image = null;
    this.pointed = null;
    this.drawn = 0;
    this.sizes = new ResizeObserver(() => this.paint());
    this.sizes.observe(this.$refs.canvas);
    this.theme = new MutationObserver(() => this.paint());
    this.theme.observe(document.body, { attributeFilter: ["class"] });
    this.$emit("ready");
  },
  unmounted() {
    this.sizes.disconnect();
    this.theme.disconnect();
  },
  methods: {
    // Called by the server with a frame; answered by the event `drawn`, so that none piles up.
    async draw(frame) {
      if (frame.first > this.rows.length) {
        // A frame was lost with a connection: the server sends all of it again.
        this.$emit("ready");
        return;
      }
      if (this.past && frame.first < this.past.count) this.past = null;
      this.rows.splice(frame.first, Infinity, ...frame.rows);
      if (frame.image !== undefined) {
        this.image = null;
        if (frame.image) {
          const image = new Image();
          image.src = frame.image;
          await image.decode();
          this.image = image;
        }
      }
      this.frame = frame;
      this.paint();
      const canvas = this.$refs.canvas;
      canvas.dataset.step = frame.shown ?? "";
      canvas.dataset.search = frame.search;
      canvas.dataset.drawn = ++this.drawn;
      this.$emit("drawn", { number: frame.number });
    },
    cellAt(event) {
      const box = this.$refs.canvas.getBoundingClientRect();
      const grid = this.frame.grid;
      const col = Math.floor(((event.clientX - box.left) / box.width) * grid);
      const row = Math.floor(((event.clientY - box.top) / box.height) * grid);
      const inside = grid && col >= 0 && row >= 0 && col < grid && row < grid;
      return inside ? [col, row] : null;
    },
    onPointer(event) {
      const cell = this.cellAt(event);
      if (String(cell) !== String(this.pointed)) this.point(cell);
    },
    onKey(event) {
      const move = KEYS[event.key];
      const last = this.frame.grid - 1;
      if (!move || last < 0) return;
      event.preventDefault();
      const far = event.shiftKey ? Math.ceil((last + 1) / 10) : 1;
      const from = this.pointed || [last >> 1, last >> 1];
      this.point(from.map((at, i) => Math.min(Math.max(at + far * move[i], 0), last)));
    },
    point(cell) {
      if (!cell && !this.pointed) return;
      this.pointed = cell;
      this.$emit("point", { cell });
      this.paint();
    },
    paint() {
      const canvas = this.$refs.canvas;
      if (!canvas || !canvas.clientWidth) return;
      const side = Math.round(canvas.clientWidth * (window.devicePixelRatio || 1));
      if (canvas.width !== side) canvas.width = canvas.height = side;
      const c = canvas.getContext("2d");
      const theme = THEMES[document.body.classList.contains("body--dark") ? "dark" : "light"];
      c.setTransform(1, 0, 0, 1, 0, 0);
      c.fillStyle = theme.sea;
      c.fillRect(0, 0, side, side);
      const grid = this.frame.grid;
      if (!grid) return;
      const cell = side / grid;
      if (this.image) {
        c.imageSmoothingEnabled = false;
        c.drawImage(this.image, 0, 0, side, side);
      }
      if (grid <= 60) this.paintGrid(c, side, cell, theme);
      const last = this.shownRows();
      const unit = side / canvas.clientWidth;
      this.paintPast(side, cell, last, theme, unit);
      c.drawImage(this.past.searched.canvas, 0, 0);
      c.drawImage(this.past.tracks.canvas, 0, 0);
      if (last) this.paintDrones(c, cell, this.rows[last - 1], theme, unit);
      this.paintVehicles(c, cell, theme, unit);
      if (this.pointed) this.paintPointed(c, cell, theme, unit);
    },
    shownRows() {
      let count = this.rows.length;
      while (count && this.rows[count - 1][0] > this.frame.shown) count--;
      return count;
    },
    paintGrid(c, side, cell, theme) {
      c.strokeStyle = theme.line;
      c.lineWidth = 1;
      c.beginPath();
      for (let i = 1; i < this.frame.grid; i++) {
        const at = Math.round(i * cell) + 0.5;
        c.moveTo(at, 0);
        c.lineTo(at, side);
        c.moveTo(0, at);
        c.lineTo(side, at);
      }
      c.stroke();
    },
    // What was done up to the step that is shown is kept as two pictures: only what is new since is
    // drawn, so that a long mission costs no more than a short one.
    paintPast(side, cell, count, theme, unit) {
      const key = [side, theme.ink, unit, this.frame.search, this.frame.names.length].join();
      if (!this.past || this.past.key !== key || this.past.count > count) {
        const layer = () => {
          const canvas = document.createElement("canvas");
          canvas.width = canvas.height = side;
          return canvas.getContext("2d");
        };
        this.past = { key, count: 0, times: new Map(), lengths: [] };
        this.past.searched = layer();
        this.past.tracks = layer();
      }
      if (this.past.count === count) return;
      this.paintSearched(this.past.searched, cell, count, theme, unit);
      this.paintTracks(this.past.tracks, cell, count, theme, unit);
      this.past.count = count;
    },
    // A frame inside each cell, thicker with each search of it; a shade where cells are small.
    paintSearched(c, cell, count, theme, unit) {
      const times = this.past.times, grid = this.frame.grid, changed = new Set();
      for (let k = this.past.count; k < count; k++) {
        const row = this.rows[k];
        for (let j = 1 + 3 * this.frame.names.length; j < row.length; j += 2) {
          const key = row[j + 1] * grid + row[j];
          times.set(key, (times.get(key) || 0) + 1);
          changed.add(key);
        }
      }
      c.strokeStyle = c.fillStyle = theme.ink;
      for (const key of changed) {
        const searches = times.get(key);
        const x = (key % grid) * cell, y = Math.floor(key / grid) * cell;
        c.clearRect(x, y, cell, cell);
        if (cell < 10 * unit) {
          c.globalAlpha = Math.min(0.12 + 0.08 * searches, 0.5);
          c.fillRect(x, y, cell, cell);
          continue;
        }
        const width = Math.max(cell * Math.min(0.02 + 0.03 * searches, 0.2), 1);
        const at = cell * 0.14 + width / 2;
        c.lineWidth = width;
        c.globalAlpha = 0.6;
        c.strokeRect(x + at, y + at, cell - 2 * at, cell - 2 * at);
      }
    },
    // Where a drone is drawn: tracks through the same cells lie beside each other.
    place(row, i, cell, lanes) {
      const lane = (((i * 2) % lanes) - (lanes - 1) / 2) * (cell / (lanes + 2));
      return [(row[1 + 3 * i] + 0.5) * cell + lane, (row[2 + 3 * i] + 0.5) * cell + lane];
    },
    lanes() {
      const count = this.frame.names.length;
      return count < 2 ? 1 : Math.min(count | 1, 7);
    },
    paintTracks(c, cell, count, theme, unit) {
      const lanes = this.lanes(), lengths = this.past.lengths;
      const from = Math.max(this.past.count - 1, 0);
      c.lineJoin = "round";
      for (let i = 0; i < this.frame.names.length; i++) {
        const path = new Path2D();
        let before = null, length = 0;
        for (let k = from; k < count; k++) {
          const [x, y] = this.place(this.rows[k], i, cell, lanes);
          if (!before) path.moveTo(x, y);
          else if (x !== before[0] || y !== before[1]) {
            path.lineTo(x, y);
            length += Math.hypot(x - before[0], y - before[1]);
          }
          before = [x, y];
        }
        if (!length) continue;
        c.setLineDash([]);
        c.lineCap = "butt";
        c.strokeStyle = theme.halo;
        c.lineWidth = 3.4 * unit;
        c.stroke(path);
        c.setLineDash(DASHES[Math.floor(i / COLOURS.length) % DASHES.length].map((d) => d * unit));
        c.lineDashOffset = lengths[i] || 0;
        c.lineCap = "round";
        c.strokeStyle = COLOURS[i % COLOURS.length];
        c.lineWidth = 1.8 * unit;
        c.stroke(path);
        lengths[i] = (lengths[i] || 0) + length;
      }
    },
    paintDrones(c, cell, row, theme, unit) {
      const lanes = this.lanes();
      const size = Math.min(Math.max(cell * 0.42, 6 * unit), 11 * unit);
      const inside = (at) => Math.min(Math.max(at, size), c.canvas.width - size);
      c.font = `600 ${11 * unit}px system-ui, sans-serif`;
      c.textBaseline = "middle";
      for (let i = 0; i < this.frame.names.length; i++) {
        const [x, y] = this.place(row, i, cell, lanes).map(inside);
        const flags = row[3 + 3 * i], state = flags & STATE;
        c.lineWidth = 1.5 * unit;
        c.fillStyle = COLOURS[i % COLOURS.length];
        c.strokeStyle = theme.ink;
        c.beginPath();
        if (state === LOST) {
          c.lineWidth = 3 * unit;
          c.strokeStyle = COLOURS[i % COLOURS.length];
          c.moveTo(x - size, y - size);
          c.lineTo(x + size, y + size);
          c.moveTo(x + size, y - size);
          c.lineTo(x - size, y + size);
        } else if (state === FINDER || flags & FOUND) {
          for (let k = 0; k < 10; k++) {
            const r = size * (k % 2 ? 0.65 : 1.6), a = (Math.PI * (k - 2.5)) / 5;
            c.lineTo(x + r * Math.cos(a), y + r * Math.sin(a));
          }
          c.closePath();
          c.fill();
        } else if (state === OUT_OF_TIME) {
          c.rect(x - size * 0.8, y - size * 0.8, size * 1.6, size * 1.6);
          c.fill();
        } else {
          c.moveTo(x, y - size);
          c.lineTo(x + size, y + size * 0.8);
          c.lineTo(x - size, y + size * 0.8);
          c.closePath();
          if (state === FLYING) c.fill();
        }
        c.stroke();
        const text = String(i);
        const left = x + size + 14 * unit > c.canvas.width;
        c.textAlign = left ? "right" : "left";
        const at = left ? x - size - 2 * unit : x + size + 2 * unit;
        c.lineWidth = 3 * unit;
        c.strokeStyle = theme.halo;
        c.strokeText(text, at, y);
        c.fillStyle = theme.ink;
        c.fillText(text, at, y);
      }
    },
    paintVehicles(c, cell, theme, unit) {
      c.strokeStyle = theme.ink;
      c.lineWidth = 1.5 * unit;
      for (const [, col, row] of this.frame.vehicles) {
        const x = (col + 0.5) * cell, y = (row + 0.5) * cell, size = 7 * unit;
        c.beginPath();
        c.arc(x, y, size, 0, 2 * Math.PI);
        c.moveTo(x - size * 1.5, y);
        c.lineTo(x + size * 1.5, y);
        c.moveTo(x, y - size * 1.5);
        c.lineTo(x, y + size * 1.5);
        c.stroke();
      }
    },
    paintPointed(c, cell, theme, unit) {
      const [col, row] = this.pointed;
      const side = Math.max(cell, 8 * unit);
      c.strokeStyle = theme.ink;
      c.lineWidth = unit;
      c.setLineDash([5 * unit, 4 * unit]);
      const [x, y] = [(col + 0.5) * cell, (row + 0.5) * cell];
      c.strokeRect(x - side / 2, y - side / 2, side, side);
      c.beginPath();
      c.moveTo(0, y);
      c.lineTo(c.canvas.width, y);
      c.moveTo(x, 0);
      c.lineTo(x, c.canvas.height);
      c.stroke();
      c.setLineDash([]);
    },
  },
};
