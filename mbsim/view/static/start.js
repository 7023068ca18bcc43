"use strict";
// Reads what the page holds, or what the server that made it sends, and mounts the view.
mbsim.start = (function () {
  async function fromPage() {
    const packs = [];
    for (const script of document.querySelectorAll("script[data-pack]")) {
      packs.push(await mbsim.unpack.read(mbsim.unpack.bytesOf(script.textContent.trim())));
    }
    return packs;
  }

  async function fromServer(count) {
    const packs = [];
    for (let k = 0; k < count; k += 1) {
      const answer = await fetch(`pack/${k}`);
      if (!answer.ok) { throw new Error(await answer.text()); }
      packs.push(await mbsim.unpack.read(new Uint8Array(await answer.arrayBuffer())));
    }
    return packs;
  }

  // While a run goes on: ask now and then whether its file has changed.
  async function watch(view, state) {
    try {
      const answer = await (await fetch("state")).json();
      if (answer.version !== state.version) {
        const follow = view.time >= view.span[1] && !view.playing;
        const packs = await fromServer(answer.runs);
        view.fill(packs);
        view.setTime(follow ? view.span[1] : view.time);
        state.version = answer.version;
      }
      if (!answer.running) { return; }
    } catch (error) { view.parts.state.textContent = "the server has stopped"; return; }
    setTimeout(() => watch(view, state), 1000);
  }

  function wait(milliseconds) { return new Promise((done) => setTimeout(done, milliseconds)); }

  async function start(root) {
    const settings = JSON.parse(root.dataset.settings || "{}");
    const failure = root.querySelector("[data-is=failure]");
    try {
      let packs, state = null;
      if (settings.live) {
        for (;;) {
          state = await (await fetch("state")).json();
          if (state.runs) { break; }
          failure.textContent = state.message;
          failure.hidden = false;
          await wait(700);
        }
        failure.hidden = true;
        packs = await fromServer(state.runs);
      } else {
        packs = await fromPage();
      }
      const view = new mbsim.View(root, packs, settings);
      view.draw();
      if (settings.live && state.running) { watch(view, state); }
      return view;
    } catch (error) {
      failure.textContent = `This page cannot be shown: ${error.message}`;
      failure.hidden = false;
      throw error;
    }
  }
  return start;
})();
