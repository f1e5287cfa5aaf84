// Playback: real time, slower and faster, of the whole recording or of what is selected.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

const find = (id) => document.getElementById(id);

export class Player {
  constructor(app) {
    this.app = app;
    this.speed = 1;
    this.playing = null;
  }

  toggle() {
    const { app } = this, last = app.about.n_samples - 1;
    if (this.playing) this.stop();
    else this.play(app.row >= last - 0.5 ? 0 : app.row, last);
  }

  playSelected() {
    const item = this.app.document.find(this.app.selection.id);
    if (item) this.play(item.start, item.end);
    else this.toggle();
  }

  play(from, to) {
    const { app } = this;
    this.stop();
    app.row = from;
    const playing = { last: null, to };
    this.playing = playing;
    this.show("❚❚", "Pause");
    const step = (now) => {
      if (this.playing !== playing) return;
      const seconds = (now - (playing.last ?? now)) / 1000;
      playing.last = now;
      app.row = Math.min(to, app.row + seconds * app.about.rate_hz * this.speed);
      if (app.view.reveal(app.row, true)) app.draw("view");
      app.draw("cursor");
      app.paint();
      if (app.row >= to) this.stop();
      else requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  stop() {
    if (!this.playing) return;
    this.playing = null;
    this.show("▶", "Play");
  }

  show(sign, name) {
    find("play").textContent = sign;
    find("play").setAttribute("aria-label", name);
  }

  change(direction) {
    const at = SPEEDS.indexOf(this.speed) + direction;
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, at))];
    find("speed").textContent = `${this.speed}×`;
  }
}
