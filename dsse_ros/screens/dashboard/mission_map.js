// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The map of a mission on a canvas. The server sends steps once, then which of them is shown.
//
// Places on the map are shares of its side from the west and from the north, those on the canvas are
// shares of its side. The window is what the canvas shows of the map. A sheet is what is drawn on,
// in pixels of the canvas:
//   c, theme  its context, in which (0, 0) is the north-west corner of the map, and the colours
//   unit      a pixel of the page
//   side      the side of the canvas; whole: that of the whole map; cell: that of a cell
//   box       the window: its west and north edge, and its side

const DASHES = [[], [6, 3], [2, 2]];
const THEMES = {
  light: {
    sea: "#ffffff", line: "#00000018", ink: "#14171a", halo: "#ffffffcc", land: "#d8cba8a0",
    edge: "#6b5f3f", wind: "#5b2a86", current: "#00606b", lkp: "#a0007a",
    open: "#9a3412", confirmed: "#166534", dismissed: "#6b7280",
  },
  dark: {
    sea: "#0d1117", line: "#ffffff16", ink: "#f3f4f6", halo: "#0d1117cc", land: "#6b5f3f80",
    edge: "#b9a878", wind: "#d4b3f5", current: "#6fdbe6", lkp: "#ff8ade",
    open: "#fdba74", confirmed: "#86efac", dismissed: "#9ca3af",
  },
};
// A drone in flight, to the right and back of where it points; an arrow where its heading is known.
const TRIANGLE = [[0, -1], [1, 0.8], [-1, 0.8]];
const ARROW = [[0, -1.5], [0.9, 1], [0, 0.5], [-0.9, 1]];
const STRIP_ALPHA = 0.2;
// The flags of a drone: its state in the lowest bits, and whether it found a person in this step.
const FLYING = 0, FINDER = 1, LOST = 3, OUT_OF_TIME = 4;
const STATE = 7, FOUND = 16;
const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const PICK_KEYS = ["Enter", " "];
const ZOOM_KEYS = { "+": 1.5, "=": 1.5, "-": 1 / 1.5, _: 1 / 1.5, 0: 0 };
// Cells along the side of the map when it is zoomed in as far as it goes.
const FEWEST_CELLS = 5;
// More drones than this have their numbers only where cells are large, as in the pictures.
const MAX_NUMBERED = 24;
// Smallest height of the canvas, as a share of its width.
const LOWEST = 0.25;
// Share of the map's width up to which a pointer that moved has clicked.
const CLICK = 0.01;
// Milliseconds without a change of the window after which tracks are drawn for it.
const STILL_MS = 150;

// A row is a step: its number; col, row and flags of each drone; then col and row of each cell that
// was looked at. In metres there are none, but the flight of each drone: its heading, on which legs
// of its path it looked (null for all), and col and row of each place on the path.
const stepOf = (row) => row[0];
const cellOf = (row, i) => [row[1 + 3 * i], row[2 + 3 * i]];
const flagsOf = (row, i) => row[3 + 3 * i];
const flightOf = (row, i, drones) => row[1 + 3 * drones + i];
const cellsLookedAt = (row, drones) => {
  const cells = [];
  for (let j = 1 + 3 * drones; j < row.length; j += 2) cells.push([row[j], row[j + 1]]);
  return cells;
};

// Draw a text with a halo.
function write({ c, theme, unit }, text, x, y, colour, weight = 400) {
  c.font = `${weight} ${11 * unit}px system-ui, sans-serif`;
  c.lineWidth = 3 * unit;
  c.lineJoin = "round";
  c.strokeStyle = theme.halo;
  c.strokeText(text, x, y);
  c.fillStyle = colour;
  c.fillText(text, x, y);
}

function strokeCircle(c, x, y, radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.stroke();
}

function fillCircle(c, x, y, radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
  c.fill();
}

// The symbols of drones, around (x, y): paths that `paintDrones` strokes.
function crossOut(c, x, y, size) {
  c.moveTo(x - size, y - size);
  c.lineTo(x + size, y + size);
  c.moveTo(x + size, y - size);
  c.lineTo(x - size, y + size);
}

function fillStar(c, x, y, size) {
  for (let k = 0; k < 10; k++) {
    const r = size * (k % 2 ? 0.65 : 1.6), a = (Math.PI * (k - 2.5)) / 5;
    c.lineTo(x + r * Math.cos(a), y + r * Math.sin(a));
  }
  c.closePath();
  c.fill();
}

function fillSquare(c, x, y, size) {
  c.rect(x - size * 0.8, y - size * 0.8, size * 1.6, size * 1.6);
  c.fill();
}

// A triangle, or an arrow along the heading, filled in flight.
function pointTo(c, x, y, size, heading, isFlying) {
  const [sin, cos] = [Math.sin(heading) * size, Math.cos(heading) * size];
  for (const [right, back] of heading === null ? TRIANGLE : ARROW) {
    c.lineTo(x + right * cos - back * sin, y + right * sin + back * cos);
  }
  c.closePath();
  if (isFlying) c.fill();
}

export default {
  template: `
    <div class="chart">
      <canvas ref="canvas" class="mission-map" tabindex="0" role="application"
        aria-roledescription="map" :aria-label="label"
        @pointermove="onPointer" @pointerdown="onPress" @pointerup="drag = null" @click="onClick"
        @pointercancel="drag = null" @pointerleave="point(null)"
        @wheel="onWheel" @touchstart="onTouch" @touchmove="onTouch" @touchend="pinch = null"
        @keydown="onKey" @blur="point(null)"></canvas>
      <div ref="lats" class="lats"></div>
      <div ref="lons" class="lons"></div>
      <div class="zoom" role="group" aria-label="Zoom">
        <button type="button" aria-label="Zoom in" title="Zoom in (+)" @click="zoomBy(1.5)">+</button>
        <button type="button" aria-label="Zoom out" title="Zoom out (-)" @click="zoomBy(1 / 1.5)">−</button>
        <button type="button" title="Whole map (0)" @click="zoomBy(0)">Whole map</button>
        <output ref="factor" aria-live="polite">1×</output>
      </div>
    </div>`,
  props: { label: String },
  mounted() {
    this.frame = { grid: [0, 0], names: [], strips: [], vehicles: [], corner: [], live: null };
    this.chart = { shore: [], sightings: [], colours: ["#000"] };
    this.edges = { marks: [[[], []], [[], []]], scale: [0, ""] };
    // What is shown of the map: its west and north edge as shares of its longer side, and how often
    // larger.
    this.window = { west: 0, north: 0, zoom: 1 };
    this.drag = this.pressed = this.pinch = this.pending = this.moving = null;
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
    cancelAnimationFrame(this.pending);
    clearTimeout(this.moving);
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
      this.chart = frame.chart || this.chart;
      this.edges = frame.edges || this.edges;
      this.nameMarks();
      this.paint();
      const canvas = this.$refs.canvas;
      const contacts = (frame.live?.contacts || []).map(([, , , state, label]) => `${label} ${state}`);
      const labels = [
        ...frame.corner.map((row) => row[3]), ...this.chart.sightings.map((s) => s[2]), ...contacts,
      ];
      canvas.setAttribute("aria-description", labels.join("; "));
      canvas.dataset.step = frame.shown ?? "";
      canvas.dataset.mapped = frame.mapped ?? "";
      canvas.dataset.search = frame.search;
      canvas.dataset.drawn = ++this.drawn;
      this.$emit("drawn", { number: frame.number });
    },

    // Pointer and keys

    // Place of a pointer on the canvas, as shares of its width.
    shareAt(event) {
      const box = this.$refs.canvas.getBoundingClientRect();
      return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.width];
    },
    cellAt(event) {
      const longer = this.longer(), { west, north, zoom } = this.window;
      const [x, y] = this.shareAt(event), [columns, rows] = this.frame.grid;
      const col = Math.floor((west + x / zoom) * longer);
      const row = Math.floor((north + y / zoom) * longer);
      const inside = x >= 0 && y >= 0 && x < 1 && y < this.high() && col < columns && row < rows;
      return inside ? [col, row] : null;
    },
    onPress(event) {
      if (event.isPrimary && event.button === 0) this.drag = this.pressed = this.shareAt(event);
      this.onPointer(event);
    },
    // A click without a drag, or a key, picks a place for a form.
    onClick(event) {
      const [x, y] = this.shareAt(event), [from_x, from_y] = this.pressed || [x, y];
      if (Math.hypot(x - from_x, y - from_y) < CLICK) this.pick([x, y]);
    },
    pick([x, y]) {
      const { west, north, zoom } = this.window;
      if (this.longer()) this.$emit("pick", { east: west + x / zoom, south: north + y / zoom });
    },
    onPointer(event) {
      if (this.drag && event.buttons && !this.pinch && this.window.zoom > 1) {
        const to = this.shareAt(event), { west, north, zoom } = this.window;
        this.$refs.canvas.setPointerCapture(event.pointerId);
        this.show(west - (to[0] - this.drag[0]) / zoom, north - (to[1] - this.drag[1]) / zoom, zoom);
        this.drag = to;
      }
      const cell = this.cellAt(event);
      if (String(cell) !== String(this.pointed)) this.point(cell);
    },
    // Where the whole map is shown, the page scrolls.
    onWheel(event) {
      if (!this.longer() || (event.deltaY >= 0 && this.window.zoom === 1)) return;
      event.preventDefault();
      const lines = event.deltaMode ? 30 : 1;
      this.zoomBy(Math.exp(-event.deltaY * lines * (event.ctrlKey ? 0.01 : 0.002)), this.shareAt(event));
    },
    // Two fingers zoom and move the map, one finger scrolls the page.
    onTouch(event) {
      if (event.touches.length !== 2) return;
      event.preventDefault();
      const [one, other] = [...event.touches].map((touch) => this.shareAt(touch));
      const at = [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2];
      const apart = Math.max(Math.hypot(one[0] - other[0], one[1] - other[1]), 0.01);
      const before = this.pinch;
      this.pinch = { at, apart };
      if (!before) return;
      const { west, north, zoom } = this.window;
      this.show(west - (at[0] - before.at[0]) / zoom, north - (at[1] - before.at[1]) / zoom, zoom);
      this.zoomBy(apart / before.apart, at);
    },
    onKey(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || !this.longer()) return;
      if (event.key in ZOOM_KEYS) {
        event.preventDefault();
        this.zoomBy(ZOOM_KEYS[event.key], this.pointed ? this.shareOf(this.pointed) : undefined);
        return;
      }
      if (PICK_KEYS.includes(event.key) && this.pointed) {
        event.preventDefault();
        this.pick(this.shareOf(this.pointed));
        return;
      }
      const move = KEYS[event.key];
      if (!move) return;
      event.preventDefault();
      const { west, north, zoom } = this.window, grid = this.frame.grid, longer = this.longer();
      const far = event.shiftKey ? Math.ceil(longer / zoom / 10) : 1;
      const middle = [west + 0.5 / zoom, north + (0.5 * this.high()) / zoom];
      const from = this.pointed || middle.map((at) => Math.floor(at * longer));
      this.point(from.map((at, i) => Math.min(Math.max(at + far * move[i], 0), grid[i] - 1)));
      this.follow(this.pointed);
    },

    // The window

    // Cells along the longer side of the map, in whose shares places are.
    longer() {
      return Math.max(...this.frame.grid);
    },
    // Height of the canvas as a share of its width; a map that is higher than wide leaves its east
    // empty.
    high() {
      return this.longer() ? Math.max(this.frame.grid[1] / this.longer(), LOWEST) : 1;
    },
    // Place of a cell's centre on the canvas, as shares of its width.
    shareOf([col, row]) {
      const { west, north, zoom } = this.window, longer = this.longer();
      return [((col + 0.5) / longer - west) * zoom, ((row + 0.5) / longer - north) * zoom];
    },
    // Move the map so that a cell is in sight.
    follow(cell) {
      const { west, north, zoom } = this.window, edge = (0.5 * zoom) / this.longer();
      const ends = [1, this.high()];
      const [x, y] = this.shareOf(cell)
        .map((at, k) => Math.min(at - edge, 0) + Math.max(at + edge - ends[k], 0));
      if (x || y) this.show(west + x / zoom, north + y / zoom, zoom);
    },
    // Zoom about a place, by default the middle; 0 shows the whole map.
    zoomBy(factor, [x, y] = [0.5, this.high() / 2]) {
      const { west, north, zoom } = this.window;
      const most = Math.max(this.longer() / FEWEST_CELLS, 1);
      let next = Math.min(Math.max(zoom * factor, 1), most);
      if (next < 1.01) next = 1;
      this.show(west + x / zoom - x / next, north + y / zoom - y / next, next);
    },
    show(west, north, zoom) {
      const inside = (edge, end) => Math.min(Math.max(edge, 0), end - end / zoom);
      this.window = { west: inside(west, 1), north: inside(north, this.high()), zoom };
      clearTimeout(this.moving);
      this.moving = setTimeout(() => {
        this.moving = null;
        this.paint();
      }, STILL_MS);
      // Many events may come before the next picture.
      if (this.pending) return;
      this.pending = requestAnimationFrame(() => {
        this.pending = null;
        const { canvas, factor } = this.$refs;
        factor.textContent = `${Number(this.window.zoom.toPrecision(2))}×`;
        canvas.dataset.zoom = this.window.zoom;
        this.nameMarks();
        this.paint();
        this.$emit("window", this.window);
      });
    },
    // Mark a cell; null marks none.
    point(cell) {
      if (!cell && !this.pointed) return;
      this.pointed = cell;
      this.$emit("point", { cell });
      this.paint();
    },
    // Draw everything, from the sea up.
    paint() {
      const canvas = this.$refs.canvas;
      if (!canvas || !canvas.clientWidth) return;
      const sheet = this.sheetOf(canvas);
      const { c, theme, side, tall, box } = sheet;
      c.setTransform(1, 0, 0, 1, 0, 0);
      c.fillStyle = theme.sea;
      c.fillRect(0, 0, side, tall);
      if (!this.longer()) return;
      const count = this.shownRows();
      // While the window moves, what was drawn for the one before moves with it.
      if (!this.moving || !this.past) this.paintPast(sheet, count);
      c.translate(-box[0], -box[1]);
      this.paintImage(sheet);
      this.paintShore(sheet);
      if (this.longer() / this.window.zoom <= 60) this.paintGrid(sheet);
      this.paintEdge(sheet);
      this.showPast(sheet);
      this.paintSightings(sheet);
      if (this.frame.live) this.paintLive(sheet);
      if (count) this.paintDrones(sheet, this.rows[count - 1]);
      this.paintVehicles(sheet);
      if (this.pointed) this.paintPointed(sheet);
      c.translate(box[0], box[1]);
      this.paintMarks(sheet);
      this.paintCorner(sheet);
      this.paintScale(sheet);
    },
    sheetOf(canvas) {
      const side = Math.round(canvas.clientWidth * (window.devicePixelRatio || 1));
      const tall = Math.round(side * this.high());
      canvas.style.aspectRatio = `1 / ${this.high()}`;
      if (canvas.width !== side || canvas.height !== tall) {
        canvas.width = side;
        canvas.height = tall;
      }
      const { west, north, zoom } = this.window;
      const whole = side * zoom;
      return {
        c: canvas.getContext("2d"),
        theme: THEMES[document.body.classList.contains("body--dark") ? "dark" : "light"],
        unit: side / canvas.clientWidth,
        side, tall, whole, cell: whole / this.longer(),
        box: [Math.round(west * whole), Math.round(north * whole), side, tall],
      };
    },
    // How many rows there are up to the step that is shown.
    shownRows() {
      let count = this.rows.length;
      while (count && stepOf(this.rows[count - 1]) > this.frame.shown) count--;
      return count;
    },

    // The place

    // The map or the belief.
    paintImage({ c, cell }) {
      if (!this.image) return;
      const [columns, rows] = this.frame.grid;
      c.imageSmoothingEnabled = false;
      c.drawImage(this.image, 0, 0, columns * cell, rows * cell);
    },
    // Where the canvas is larger than the map, what is the map.
    paintEdge({ c, theme, unit, cell }) {
      const [columns, rows] = this.frame.grid;
      if (columns === rows) return;
      c.strokeStyle = theme.edge;
      c.lineWidth = unit;
      c.strokeRect(0, 0, columns * cell, rows * cell);
    },
    paintShore({ c, theme, unit, whole }) {
      const land = new Path2D();
      for (const ring of this.chart.shore) {
        ring.forEach(([x, y], i) => land[i ? "lineTo" : "moveTo"](x * whole, y * whole));
        land.closePath();
      }
      c.fillStyle = theme.land;
      c.fill(land, "evenodd");
      c.strokeStyle = theme.edge;
      c.lineWidth = 1.2 * unit;
      c.stroke(land);
    },
    paintGrid({ c, theme, cell }) {
      const [columns, rows] = this.frame.grid;
      c.strokeStyle = theme.line;
      c.lineWidth = 1;
      c.beginPath();
      for (let i = 1; i < columns; i++) {
        const at = Math.round(i * cell) + 0.5;
        c.moveTo(at, 0);
        c.lineTo(at, rows * cell);
      }
      for (let i = 1; i < rows; i++) {
        const at = Math.round(i * cell) + 0.5;
        c.moveTo(0, at);
        c.lineTo(columns * cell, at);
      }
      c.stroke();
    },
    // A circle with a dot, as the fix of a chart, in the circle of its uncertainty; the lines of
    // areas, voyages and bearings.
    paintSightings(sheet) {
      const { c, theme, unit, whole } = sheet;
      c.textBaseline = "middle";
      this.chart.sightings.forEach(([[x, y], radius, label, to, lines]) => {
        [x, y] = [x * whole, y * whole];
        c.strokeStyle = c.fillStyle = theme.lkp;
        c.lineWidth = 1.2 * unit;
        c.beginPath();
        for (const line of lines) {
          line.forEach(([east, south], i) => c[i ? "lineTo" : "moveTo"](east * whole, south * whole));
        }
        c.stroke();
        strokeCircle(c, x, y, radius * whole);
        if (!to) return;
        c.lineWidth = 2 * unit;
        strokeCircle(c, x, y, 5.5 * unit);
        fillCircle(c, x, y, 1.8 * unit);
        c.textAlign = to[0] > 0 ? "left" : "right";
        write(sheet, label, x + 9 * unit * to[0], y - 9 * unit * to[1], theme.lkp, 600);
      });
    },
    // The marks in sight of longitude and latitude: shares of the canvas's width, and labels.
    marksInSight() {
      const { west, north, zoom } = this.window;
      return this.edges.marks.map(([shares, labels], k) => shares
        .map((share, i) => [(share - [west, north][k]) * zoom, labels[i]])
        .filter(([at]) => at >= 0 && at <= [1, this.high()][k]));
    },
    // Longitude below the southern edge, latitude beside the eastern one.
    nameMarks() {
      const marks = this.marksInSight();
      [["lons", "left"], ["lats", "top"]].forEach(([edge, start], k) => {
        this.$refs[edge].replaceChildren(...marks[k].map(([at, label]) => {
          const name = document.createElement("span");
          name.style[start] = `clamp(2em, ${(100 * at) / [1, this.high()][k]}%, 100% - 2em)`;
          name.textContent = label;
          return name;
        }));
      });
    },
    paintMarks({ c, theme, unit, side, tall }) {
      const [lons, lats] = this.marksInSight().map((marks) => marks.map(([at]) => at * side));
      c.strokeStyle = theme.ink;
      c.lineWidth = 1.5 * unit;
      c.beginPath();
      for (const x of lons) {
        c.moveTo(x, tall);
        c.lineTo(x, tall - 6 * unit);
      }
      for (const y of lats) {
        c.moveTo(side, y);
        c.lineTo(side - 6 * unit, y);
      }
      c.stroke();
    },
    // A bar of a round length in the south-west corner, and north beside it.
    paintScale(sheet) {
      const { c, theme, unit, side, tall } = sheet;
      const [length, label] = this.edges.scale;
      const x = 12 * unit, y = tall - 14 * unit;
      const end = x + length * this.window.zoom * side, north = end + 60 * unit;
      c.textAlign = "left";
      c.textBaseline = "bottom";
      for (const [colour, width] of [[theme.halo, 5], [theme.ink, 2]]) {
        c.strokeStyle = colour;
        c.lineWidth = width * unit;
        c.beginPath();
        c.moveTo(x, y - 4 * unit);
        c.lineTo(x, y);
        c.lineTo(end, y);
        c.lineTo(end, y - 4 * unit);
        c.moveTo(north, y);
        c.lineTo(north, y - 20 * unit);
        c.moveTo(north - 4 * unit, y - 14 * unit);
        c.lineTo(north, y - 20 * unit);
        c.lineTo(north + 4 * unit, y - 14 * unit);
        c.stroke();
      }
      write(sheet, label, x, y - 5 * unit, theme.ink, 600);
      write(sheet, "N", north + 7 * unit, y - 6 * unit, theme.ink, 600);
    },
    // Arrows in the north-west corner: to where wind and current go, and to sightings off the map.
    paintCorner(sheet) {
      const { c, theme, unit } = sheet;
      c.textAlign = "left";
      c.textBaseline = "middle";
      this.frame.corner.forEach(([kind, east, north, label], i) => {
        const x = 20 * unit, y = (18 + 22 * i) * unit, half = 10 * unit;
        const a = Math.atan2(-north, east);
        c.save();
        c.translate(x, y);
        c.rotate(a);
        c.strokeStyle = c.fillStyle = theme[kind];
        c.lineWidth = 2.2 * unit;
        c.beginPath();
        c.moveTo(-half, 0);
        c.lineTo(half * 0.4, 0);
        c.stroke();
        c.beginPath();
        c.moveTo(half, 0);
        c.lineTo(half * 0.1, half * 0.5);
        c.lineTo(half * 0.1, -half * 0.5);
        c.fill();
        c.restore();
        write(sheet, label, x + 16 * unit, y, theme[kind], 600);
      });
    },

    // A live search

    // Contacts, and what is being entered.
    paintLive(sheet) {
      const { contacts, sketch, closed } = this.frame.live;
      sheet.c.textBaseline = "middle";
      sheet.c.textAlign = "left";
      this.paintContacts(sheet, contacts);
      if (sketch.length) this.paintSketch(sheet, sketch, closed);
    },
    // Contacts as diamonds in the circle of their uncertainty, crossed out if they are dismissed.
    paintContacts(sheet, contacts) {
      const { c, theme, unit, whole } = sheet;
      // The most probable one is drawn last, and its label has its place first.
      const places = this.labelPlaces(sheet, contacts);
      for (const [[east, south], radius, name, state, label] of [...contacts].reverse()) {
        const [x, y] = [east * whole, south * whole], half = 7 * unit;
        c.strokeStyle = c.fillStyle = theme[state];
        c.lineWidth = 1.2 * unit;
        c.beginPath();
        if (state !== "dismissed") c.arc(x, y, radius * whole, 0, 2 * Math.PI);
        c.stroke();
        c.lineWidth = 2 * unit;
        c.beginPath();
        c.moveTo(x, y - half);
        c.lineTo(x + half, y);
        c.lineTo(x, y + half);
        c.lineTo(x - half, y);
        c.closePath();
        if (state === "confirmed") c.fill();
        if (state === "dismissed") {
          c.moveTo(x - half, y - half);
          c.lineTo(x + half, y + half);
        }
        c.stroke();
        const at = places.get(name);
        if (at) write(sheet, label, at[0], at[1], theme[state], 600);
      }
    },
    paintSketch({ c, theme, unit, whole }, sketch, closed) {
      const line = new Path2D();
      for (const [east, south] of sketch) line.lineTo(east * whole, south * whole);
      if (closed) line.closePath();
      c.strokeStyle = c.fillStyle = theme.ink;
      c.lineWidth = 2 * unit;
      c.setLineDash([6 * unit, 4 * unit]);
      c.stroke(line);
      c.setLineDash([]);
      for (const [east, south] of sketch) fillCircle(c, east * whole, south * whole, 4 * unit);
    },
    // Where the labels of contacts are, by name: beside their mark, off all other marks and labels.
    // Without room a label is left out: the table has all.
    labelPlaces({ c, unit, whole }, contacts) {
      const places = new Map(), high = 13 * unit, far = 10 * unit;
      const taken = contacts.map(([[x, y]]) => [x * whole - far / 1.2, y * whole, (2 * far) / 1.2]);
      c.font = `600 ${11 * unit}px system-ui, sans-serif`;
      for (const [[east, south], , name, , label] of contacts) {
        const [x, y] = [east * whole, south * whole], wide = c.measureText(label).width;
        const tries = [];
        for (let row = 0; row < 3; row++) {
          for (const up of row ? [row, -row] : [0]) {
            tries.push([x + far, y + up * high], [x - far - wide, y + up * high]);
          }
        }
        const isFree = ([left, middle]) => !taken.some(([other, height, width]) =>
          left < other + width && other < left + wide && Math.abs(middle - height) < high);
        const at = tries.find(isFree);
        if (!at) continue;
        taken.push([at[0], at[1], wide + 3 * unit]);
        places.set(name, at);
      }
      return places;
    },

    // The past

    // What was done up to the step that is shown is kept as two pictures: only what is new since is
    // drawn, so that a long mission costs no more than a short one.
    paintPast(sheet, count) {
      const { theme, unit, cell, box } = sheet;
      const key = [box, cell, theme.ink, unit, this.frame.search, this.frame.names.length].join();
      if (!this.past || this.past.key !== key || this.past.count > count) {
        this.past = {
          key, box, cell, count: 0,
          searched: this.newLayer(box), times: new Map(),
          tracks: this.newLayer(box), lengths: [],
        };
      }
      if (this.past.count === count) return;
      const searched = { ...sheet, c: this.past.searched }, tracks = { ...sheet, c: this.past.tracks };
      if (this.frame.strips.length) this.paintStrips(searched, count);
      else this.paintSearched(searched, count);
      this.paintTracks(tracks, count);
      this.past.count = count;
    },
    newLayer([west, north, side, tall]) {
      const canvas = document.createElement("canvas");
      canvas.width = side;
      canvas.height = tall;
      const layer = canvas.getContext("2d");
      layer.translate(-west, -north);
      return layer;
    },
    showPast({ c, cell }) {
      const box = this.past.box.map((at) => (at * cell) / this.past.cell);
      for (const layer of [this.past.searched, this.past.tracks]) {
        // Strips of steps overlap.
        const isStrips = layer === this.past.searched && this.frame.strips.length;
        c.globalAlpha = isStrips ? STRIP_ALPHA : 1;
        c.drawImage(layer.canvas, ...box);
      }
      c.globalAlpha = 1;
    },
    // In metres, where a drone flew and how far it saw.
    paintStrips({ c, theme, cell }, count) {
      const from = Math.max(this.past.count - 2, 0);
      c.strokeStyle = theme.ink;
      c.lineJoin = "round";
      this.frame.strips.forEach((width, i) => {
        c.lineWidth = width * cell;
        c.stroke(this.way(i, from, count, cell, true)[0]);
      });
    },
    // A frame inside each cell, thicker with each search of it; a shade where cells are small.
    paintSearched(sheet, count) {
      const { c, theme, cell } = sheet;
      const times = this.past.times, columns = this.frame.grid[0], changed = new Set();
      for (const row of this.rows.slice(this.past.count, count)) {
        for (const [col, line] of cellsLookedAt(row, this.frame.names.length)) {
          const key = line * columns + col;
          times.set(key, (times.get(key) || 0) + 1);
          changed.add(key);
        }
      }
      c.strokeStyle = c.fillStyle = theme.ink;
      for (const key of changed) {
        const x = (key % columns) * cell, y = Math.floor(key / columns) * cell;
        this.paintSearchedCell(sheet, x, y, times.get(key));
      }
    },
    paintSearchedCell({ c, unit, cell }, x, y, searches) {
      c.clearRect(x, y, cell, cell);
      if (cell < 10 * unit) {
        c.globalAlpha = Math.min(0.12 + 0.08 * searches, 0.5);
        c.fillRect(x, y, cell, cell);
        return;
      }
      const width = Math.max(cell * Math.min(0.02 + 0.03 * searches, 0.2), 1);
      const at = cell * 0.14 + width / 2;
      c.lineWidth = width;
      c.globalAlpha = 0.6;
      c.strokeRect(x + at, y + at, cell - 2 * at, cell - 2 * at);
    },
    paintTracks({ c, theme, unit, cell }, count) {
      const lengths = this.past.lengths;
      const from = Math.max(this.past.count - 1, 0);
      c.lineJoin = "round";
      for (let i = 0; i < this.frame.names.length; i++) {
        const [path, length] = this.way(i, from, count, cell);
        if (!length) continue;
        c.setLineDash([]);
        c.lineCap = "butt";
        c.strokeStyle = theme.halo;
        c.lineWidth = 3.4 * unit;
        c.stroke(path);
        const cycle = Math.floor(i / this.chart.colours.length);
        c.setLineDash(DASHES[cycle % DASHES.length].map((d) => d * unit));
        c.lineDashOffset = lengths[i] || 0;
        c.lineCap = "round";
        c.strokeStyle = this.chart.colours[i % this.chart.colours.length];
        c.lineWidth = 1.8 * unit;
        c.stroke(path);
        lengths[i] = (lengths[i] || 0) + length;
      }
    },
    // The way of a drone from one row to another, or what of it it looked on, and its length.
    way(i, from, count, cell, searching = false) {
      const path = new Path2D();
      let before = null, length = 0;
      const add = (x, y, is_drawn) => {
        if (!before || !is_drawn) path.moveTo(x, y);
        else if (x !== before[0] || y !== before[1]) {
          path.lineTo(x, y);
          length += Math.hypot(x - before[0], y - before[1]);
        }
        before = [x, y];
      };
      for (let k = from; k < count; k++) {
        const [, looked, ...places] = k > from ? this.flightIn(this.rows[k], i) : [null, null];
        const is_drawn = (leg) => !searching || !looked || looked[leg];
        for (let p = 0; p < places.length; p += 2) {
          add((places[p] + 0.5) * cell, (places[p + 1] + 0.5) * cell, is_drawn(p / 2));
        }
        add(...this.place(this.rows[k], i, cell), is_drawn(places.length / 2));
      }
      return [path, length];
    },
    // Where a drone is drawn. On cells, tracks through the same ones lie beside each other.
    place(row, i, cell) {
      const lanes = this.lanes();
      const lane = (((i * 2) % lanes) - (lanes - 1) / 2) * (cell / (lanes + 2));
      return cellOf(row, i).map((at) => (at + 0.5) * cell + lane);
    },
    lanes() {
      const count = this.frame.names.length;
      return count < 2 || this.frame.strips.length ? 1 : Math.min(count | 1, 7);
    },
    // The flight of a drone in a row; on cells it has none.
    flightIn(row, i) {
      const names = this.frame.names;
      return this.frame.strips.length ? flightOf(row, i, names.length) : [null, null];
    },

    // The present

    paintDrones(sheet, row) {
      const { c, theme, unit, cell, box } = sheet;
      const many = this.frame.names.length > MAX_NUMBERED;
      const size = Math.min(Math.max(cell * 0.42, (many ? 4 : 6) * unit), 11 * unit);
      const numbered = !many || cell >= 24 * unit;
      // A drone in a cell at the edge is drawn as a whole, unless the edge is only that of the window.
      const ends = this.frame.grid.map((count) => count * cell);
      const inside = (at, k) => Math.min(Math.max(at, size), ends[k] - size);
      const outside = (at, k) => at < box[k] - size || at > box[k] + box[2 + k] + size;
      c.textBaseline = "middle";
      for (let i = 0; i < this.frame.names.length; i++) {
        const [x, y] = this.place(row, i, cell).map(inside);
        if (outside(x, 0) || outside(y, 1)) continue;
        const flags = flagsOf(row, i), state = flags & STATE;
        c.lineWidth = 1.5 * unit;
        c.fillStyle = this.chart.colours[i % this.chart.colours.length];
        c.strokeStyle = theme.ink;
        c.beginPath();
        if (state === LOST) {
          c.lineWidth = 3 * unit;
          c.strokeStyle = this.chart.colours[i % this.chart.colours.length];
          crossOut(c, x, y, size);
        } else if (state === FINDER || flags & FOUND) {
          fillStar(c, x, y, size);
        } else if (state === OUT_OF_TIME) {
          fillSquare(c, x, y, size);
        } else {
          pointTo(c, x, y, size, this.flightIn(row, i)[0], state === FLYING);
        }
        c.stroke();
        if (!numbered) continue;
        const text = String(i);
        const left = x + size + 14 * unit > box[0] + box[2];
        c.textAlign = left ? "right" : "left";
        const at = left ? x - size - 2 * unit : x + size + 2 * unit;
        write(sheet, text, at, y, theme.ink, 600);
      }
    },
    paintVehicles({ c, theme, unit, cell }) {
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
    paintPointed({ c, theme, unit, cell, box }) {
      const [col, row] = this.pointed;
      const side = Math.max(cell, 8 * unit);
      c.strokeStyle = theme.ink;
      c.lineWidth = unit;
      c.setLineDash([5 * unit, 4 * unit]);
      const [x, y] = [(col + 0.5) * cell, (row + 0.5) * cell];
      c.strokeRect(x - side / 2, y - side / 2, side, side);
      c.beginPath();
      c.moveTo(box[0], y);
      c.lineTo(box[0] + box[2], y);
      c.moveTo(x, box[1]);
      c.lineTo(x, box[1] + box[3]);
      c.stroke();
      c.setLineDash([]);
    },
  },
};
