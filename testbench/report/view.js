"use strict";
/* What the viewer adds to the page's script: samples, spectra and differences are asked for as they are looked at. */
window.live = ({ at, made, asked }) => {
  /* A line that is drawn knows what it was asked for: the words, and from where to where its samples reach. */
  const WIDTHS = 3;
  /* How far samples must reach before and after the view, and are asked for, in its widths: moving back, zooming, moving on. */
  const MARGINS = [[[1, 0], [2, 0.25]], [[0.25, 0.25], [1, 1]], [[0, 1], [0.25, 2]]];
  const complain = (error) => { at("series-error").textContent = error.message; };
  const fetched = async (one, from, to, spans) => {
    const found = await asked(one.ask.name, { ...one.ask.words, from, to, spans }).catch((error) => {
      complain(error);
      return { values: "", frequency_hz: one.ask.name === "spectrum" ? [] : undefined, density: [] };
    });
    Object.assign(one, found, { curve: null, from, to });
  };
  const spans = () => Math.max(200, Math.round(at("series-plots").clientWidth));

  let wanted = null, busy = false, lastShown = null;
  const live = {
    /* The lines of plots, with those of differences to the first run; over frequency, of the time that is shown. */
    async load(drawn, over, shown) {
      at("series-error").textContent = "";
      at("series-note").textContent = "Reading …";
      const range = over === "frequency" && lastShown ? lastShown : [-1e300, 1e300];
      const plots = drawn.flatMap(({ name, lines }) => {
        const first = lines[0].run.name, own = lines.map(({ run, one, hue }) => ({
          run, hue,
          one: { ...one, ask: { name: over === "time" ? "samples" : "spectrum", words: { run: run.id, channel: one.id, first: lines[0].run.id } } },
        }));
        const apart = own.slice(1).map(({ run, hue, one }) => ({
          run, hue, label: `${run.name} less ${first}`, one: { ...one, ask: { ...one.ask, name: "difference" } },
        }));
        return [{ name, lines: own }, ...(over === "time" && apart.length ? [{ name: `${name}: difference to ${first}`, lines: apart }] : [])];
      });
      await Promise.all(plots.flatMap(({ lines }) => lines.map(({ one }) => fetched(one, ...range, spans()))));
      if (over === "time") lastShown = null;
      return plots;
    },
    /* Asks anew for what is too coarse, or ends too near, ahead of where the view moves; one request a line at a time,
       the last wish wins. */
    async look(plots, min, max, renewed) {
      if (!plots.length || !plots[0].lines[0].one.values) return;
      const moved = lastShown && Math.abs(lastShown[1] - lastShown[0] - max + min) < 1e-6 * (max - min) ? Math.sign(min - lastShown[0]) : 0;
      lastShown = [min, max];
      wanted = { plots, min, max, margins: MARGINS[moved + 1] };
      if (busy) return;
      busy = true;
      try {
        while (wanted) {
          const { plots: some, min: low, max: high, margins } = wanted, width = high - low;
          wanted = null;
          await Promise.all(some.map(async (plot) => {
            const [start, end] = plot.ends;
            const [[near, far], [left, right]] = margins.map(([before, after]) => [Math.max(low - before * width, start), Math.min(high + after * width, end)]);
            const lacking = plot.lines.map(({ one }) => one).filter((one) => one.from > near || one.to < far
              || (!one.whole && Math.min(one.to, end) - Math.max(one.from, start) > 2 * (right - left)));
            if (!lacking.length || right <= left) return; // or the view is beside what this plot holds
            await Promise.all(lacking.map((one) => fetched(one, left, right, WIDTHS * spans())));
            if (!plot.box.isConnected) return;
            const last = wanted || { min: low, max: high };
            renewed(plot, last.min, last.max);
          }));
        }
      } finally { busy = false; }
    },
  };

  /* Findings, and the decisions of a person about them. */
  const form = (code) => {
    const one = made("form", "", { class: "controls" });
    const [by, reason] = ["by", "reason"].map((name) => made("input", "", { name, required: true, maxlength: 500 }));
    const state = made("p", "", { class: "note" });
    state.setAttribute("role", "status");
    for (const [text, input] of [["Your name", by], ["Reason", reason]]) {
      const label = made("label", text);
      label.append(input);
      one.append(label);
    }
    one.append(made("button", `Accept ${code}`), state);
    one.addEventListener("submit", async (event) => {
      event.preventDefault();
      try {
        list(await asked("accept", { code, by: by.value, reason: reason.value }, "POST"));
      } catch (error) { state.textContent = error.message; }
    });
    return one;
  };
  const list = ({ verdict, findings }) => {
    at("findings-state").textContent = verdict;
    at("findings-list").replaceChildren(...findings.map(({ code, count, decision, meaning, messages }) => {
      const one = made("details"), items = made("ul");
      items.append(...messages.map((message) => made("li", message)));
      one.append(made("summary", `${code}: ${count} — ${decision}`), made("p", meaning), items);
      if (decision.startsWith("open")) one.append(form(code));
      return one;
    }));
  };
  asked("findings", {}).then(list, (error) => { at("findings-state").textContent = error.message; });
  return live;
};
