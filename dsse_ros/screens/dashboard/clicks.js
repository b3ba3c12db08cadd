// Copyright 2026 dsse_ros maintainers
// SPDX-License-Identifier: Apache-2.0
// The clicks on commands: each is sent at once and with its time, or the page says that it was not.

// As MAX_AGE_S in commands.py.
const LATE_MS = 5000;
// Number of the last times of the server that are compared.
const TIMES = 20;

export default {
  template: `<div class="trouble" role="alert">{{ text }}</div>`,
  data: () => ({ text: "" }),
  mounted() {
    this.offsets = [];
    this.waiting = [];
    this.count = 0;
    this.unconfirmed = new Map();
    this.listens = false;
    window.sendClick = (emit, event) =>
      this.send(emit, event.currentTarget.querySelector(".block").textContent);
  },
  methods: {
    // Called by the server with its time, in s. A click states what that clock shows: however long
    // it is on its way, the server knows its age. A time that was long on its way makes clicks
    // older, so that the one that was shortest counts.
    sendTime(now) {
      this.offsets = [...this.offsets, now - performance.now() / 1000].slice(-TIMES);
      this.sendWaiting();
    },
    // A page that has just been loaded does not have the time yet.
    sendWaiting() {
      if (!this.offsets.length) return;
      const offset = Math.max(...this.offsets);
      for (const { emit, number, at } of this.waiting.splice(0)) emit({ number, at: at + offset });
    },
    // A socket without a connection would keep the click, and send it whenever it has one again.
    send(emit, label) {
      if (!window.socket?.connected) {
        this.text = `There is no connection: ${label} was not sent.`;
        return;
      }
      // When this is mounted, there is no socket yet.
      if (!this.listens) window.socket.on("disconnect", () => this.onDisconnect());
      this.listens = true;
      const number = ++this.count;
      this.unconfirmed.set(number, label);
      setTimeout(() => this.onLate(number), LATE_MS);
      this.waiting.push({ emit, number, at: performance.now() / 1000 });
      this.sendWaiting();
    },
    onLate(number) {
      const label = this.unconfirmed.get(number);
      if (label) this.text = `There is no answer: ${label} may not have been sent. Load the page again.`;
    },
    onDisconnect() {
      this.waiting = [];
      if (!this.unconfirmed.size) return;
      const labels = [...this.unconfirmed.values()].join(", ");
      this.text = `The connection was lost: ${labels} may not have been sent.`;
      this.unconfirmed.clear();
    },
    // Called by the server with the number of a click that it has got.
    confirm(number) {
      this.unconfirmed.delete(number);
      this.text = "";
    },
  },
};
