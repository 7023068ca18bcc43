// The view of a report, and a strip of pictures of it for paper.
(function () {
  const root = document.getElementById("view");
  if (!root) { return; }
  const strip = document.getElementById("strip"), COUNT = 6;

  function take(view) {
    const { canvas } = view, before = view.time;
    const theme = view.theme;
    view.setTheme("light");
    for (let k = 0; k < COUNT; k += 1) {
      const time = view.span[0] + (view.span[1] - view.span[0]) * k / (COUNT - 1);
      view.setTime(time);
      view.draw();
      const copy = document.createElement("canvas");
      copy.width = 640;
      copy.height = Math.round(640 * canvas.height / canvas.width);
      copy.getContext("2d").drawImage(canvas, 0, 0, copy.width, copy.height);
      const figure = document.createElement("figure"), words = document.createElement("figcaption");
      words.textContent = `${view.parts.clock.firstChild.textContent} ${view.runs[0].about.units.time}`;
      figure.append(copy, words);
      strip.append(figure);
    }
    view.setTheme(theme);
    view.setTime(before);
  }

  window.mbsimReady = mbsim.start(root).then(function (view) {
    window.mbsimView = view;
    take(view);
    return view;
  });
  window.addEventListener("beforeprint", function () {
    for (const part of document.querySelectorAll("section > details")) { part.open = true; }
  });
})();
