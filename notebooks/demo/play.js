// What moves by itself: the run that is played, and work between the frames.

const player = {
  mode: null, // "play", "rush" or null
  last: 0, // when the last step was played

  toggle() {
    if (this.mode) return this.pause();
    if (state.view === "robot") robotView.goOn();
    this.run("play");
  },

  // All that is left of the run, as fast as the machine can, a frame at a time.
  rush() {
    if (robotView.experiment?.done) return say("The training is over: Play goes on with what was learnt, Restart begins anew.");
    this.run("rush");
  },

  run(mode) {
    if (state.view === "robot" && !robotView.world) return;
    say("");
    this.last = 0;
    this.tell(mode);
    requestAnimationFrame((time) => this.frame(time));
  },

  pause() {
    this.tell(null);
  },

  tell(mode) {
    this.mode = mode;
    for (const button of document.querySelectorAll("[data-act=play]")) button.textContent = mode ? "Pause" : "Play";
  },

  frame(time) {
    if (!this.mode) return;
    if (view().hand) this.last = time; // what is held stands still
    else if (this.mode === "rush") {
      const until = performance.now() + 12;
      while (performance.now() < until && robotView.advance());
      robotView.show();
    } else if (time - this.last >= 125) {
      this.last = time;
      view().step();
    }
    if (view().over) return this.pause();
    requestAnimationFrame((next) => this.frame(next));
  },
};

const jobs = new Map(); // generators by name, with the view that they are for
let atWork = false;

// Go through a generator a few milliseconds a frame, while its view is seen and nothing is played.
function between(name, view, steps) {
  jobs.set(name, { view, steps });
  if (!atWork) setTimeout(goOn, 200);
  atWork = true;
}

function goOn() {
  const until = performance.now() + 8;
  let moved = false;
  for (const [name, job] of jobs) {
    if (job.view !== state.view || player.mode || document.hidden) continue;
    moved = true;
    while (jobs.get(name) === job && performance.now() < until) if (job.steps.next().done) jobs.delete(name);
  }
  atWork = jobs.size > 0;
  if (atWork) moved ? requestAnimationFrame(goOn) : setTimeout(goOn, 200);
}
