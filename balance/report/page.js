"use strict";
(() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const at = (id) => document.getElementById(id);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const made = (tag, text, attributes = {}) => {
    const one = document.createElement(tag);
    if (text) one.textContent = text;
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    return one;
  };
  const steps = (text) => {
    const raw = atob(text), bytes = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
    return new Int16Array(bytes.buffer);
  };

  /* The answer of the program that serves this page. */
  const asked = async (name, words, method = "GET") => {
    const text = method === "GET" ? `${name}?${new URLSearchParams(words)}` : name;
    const given = method === "GET" ? {} : { method, headers: { "Content-Type": "application/json" }, body: JSON.stringify(words) };
    const ended = () => { throw new Error("The program that serves this page does not answer: it has ended. Start it again, and open its new address."); };
    const answer = await fetch(text, given).catch(ended), found = await answer.json();
    if (!answer.ok) throw new Error(found.error);
    return found;
  };
  const live = window.live && window.live({ data, at, made, asked });

  /* The pictures of a motion in a place of the page; what is given back draws one of them. */
  const SVG = "http://www.w3.org/2000/svg";
  const element = (tag, attributes) => {
    const one = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    return one;
  };
  const pictured = (host, motion) => {
    const panels = motion.panels.map((panel) => {
      const figure = made("figure"), caption = made("figcaption", panel.label), svg = element("svg", {
        role: "img", viewBox: `0 0 ${motion.width} ${motion.height}`,
        "aria-label": `${motion.name}, ${panel.label}: the mechanism, its centre of mass and the shaking force`,
      });
      for (const shape of panel.shapes) {
        const closed = shape.kind === "link" || shape.kind === "payload";
        const line = closed || shape.kind === "stay" || shape.kind === "force";
        const one = element(closed ? "polygon" : line ? "polyline" : "circle", { class: shape.kind });
        if (!line) one.setAttribute("r", shape.radius === undefined ? 9 : shape.radius);
        if (shape.label) one.append(Object.assign(element("title", {}), { textContent: shape.label }));
        svg.append(one);
      }
      const shapes = [...svg.children];
      const low = motion.height - 25, text = element("text", { x: 30, y: low - 10 });
      text.textContent = `${+(1000 * motion.scale_bar_m).toPrecision(3)} mm`;
      svg.append(element("line", { class: "bar", x1: 30, x2: 30 + motion.scale_bar, y1: low, y2: low }), text);
      figure.append(svg, caption);
      return { panel, figure, caption, shapes, points: steps(panel.points) };
    });
    host.replaceChildren(...panels.map(({ figure }) => figure));
    const rounding = 1e-6 * Math.max(...motion.panels.map((panel) => panel.largest_N));
    return (frame) => {
      for (const { panel, points, shapes, caption } of panels) {
        const place = (i) => [0, 1].map((k) => points[2 * (frame * panel.count + i) + k] / 10);
        panel.shapes.forEach((shape, k) => {
          const one = shapes[k];
          if (one.tagName === "circle") {
            const [x, y] = place(shape.points[0]);
            one.setAttribute("cx", x);
            one.setAttribute("cy", y);
          } else one.setAttribute("points", shape.points.map((i) => place(i).join()).join(" "));
        });
        if (motion.time.length > 1) caption.textContent = `${panel.label}: shaking force ${panel.force_N[frame] < rounding ? 0 : panel.force_N[frame]} N, largest ${+panel.largest_N.toPrecision(4)} N`;
      }
    };
  };

  /* The mechanism in motion. */
  const motions = data.motions || [];
  let show = () => {};
  if (motions.length) {
    const slider = at("motion-time"), play = at("motion-play");
    let motion = motions[0], picture = null, playing = 0, begun = 0, from = 0;
    show = (one) => {
      motion = one;
      picture = pictured(at("motion-panels"), motion);
      slider.max = motion.time.length - 1;
      at("motion-view").textContent = motion.view[0].toUpperCase() + motion.view.slice(1);
      draw(Number(slider.value));
    };
    const draw = (frame) => {
      picture(frame);
      const now = `t = ${motion.time[frame].toFixed(3)} s`;
      at("motion-now").textContent = now;
      slider.setAttribute("aria-valuetext", now);
    };
    const stop = () => {
      cancelAnimationFrame(playing);
      playing = 0;
      play.textContent = "Play";
      play.setAttribute("aria-pressed", "false");
    };
    const tick = (now) => {
      const time = motion.time, passed = from + (now - begun) / 1000 * Number(at("motion-speed").value);
      if (passed >= time[time.length - 1]) { begun = now; from = time[0]; }
      const frame = time.findIndex((t) => t >= passed);
      slider.value = frame < 0 ? 0 : frame;
      draw(Number(slider.value));
      playing = requestAnimationFrame(tick);
    };
    play.addEventListener("click", () => {
      if (playing) return stop();
      play.textContent = "Pause";
      play.setAttribute("aria-pressed", "true");
      begun = performance.now();
      from = motion.time[Number(slider.value)];
      playing = requestAnimationFrame(tick);
    });
    slider.addEventListener("input", () => { stop(); draw(Number(slider.value)); });
    at("motion-choice").addEventListener("change", (event) => { stop(); slider.value = 0; show(motions[event.target.value]); });
    at("motion-choice").parentElement.hidden = motions.length < 2;
    at("motion-controls").hidden = false;
    show(motion);
  }

  /* Time series and spectra. */
  const runs = data.runs || [];
  let renew = () => {};
  if (runs.length) {
    const conditions = data.conditions || [], help = at("series-help"), kinds = at("series-kind");
    let plots = [], moving = false, turns = 0;
    const chosen = () => [...new Set(["series-a", "series-b"]
      .flatMap((id) => [...at(id).selectedOptions].map((option) => runs[option.value])).filter((run) => run))];
    const over = () => at("series-over").value;
    const curve = (one) => {
      if (one.frequency_hz) return [one.frequency_hz, one.density];
      if (!one.curve) {
        const raw = steps(one.values), scale = (one.high - one.low) / 65534, x = [], y = [];
        for (let i = 0; i < raw.length; i++) {
          x.push(one.start + (one.whole ? i : i + 0.5) * one.step);
          y.push(raw[i] === -32768 ? null : one.low + (raw[i] + 32767) * scale);
        }
        one.curve = [x, y];
        if (one.half_width) {
          const [, half] = curve(one.half_width), none = (i) => half[i] === null || y[i] === null;
          const wide = (i) => Math.max(half[i], one.whole ? 0 : half[i ^ 1]);
          one.curve.push(...[-1, 1].map((sign) => y.map((value, i) => (none(i) ? null : value + sign * wide(i)))));
        }
      }
      return one.curve;
    };
    const listed = (run) => (over() === "time" ? run.channels : run.spectra);
    const offer = () => {
      const all = chosen().flatMap(listed), before = kinds.value;
      const names = [...new Set([...all.map((one) => one.kind), ...all.map((one) => one.name)])];
      kinds.replaceChildren(...names.map((name) => made("option", name, { value: name })));
      if (names.includes(before)) kinds.value = before;
    };
    const stated = (plot) => {
      const { min, max } = plot.u.scales.x;
      if (min === null || min === undefined) return;
      const unit = over() === "time" ? "s" : "Hz";
      const parts = plot.u.series.slice(1).filter((line) => line.width).map((line) => {
        let low = Infinity, high = -Infinity;
        const values = plot.u.data[plot.u.series.indexOf(line)];
        plot.u.data[0].forEach((x, i) => {
          const y = values[i];
          if (x >= min && x <= max && y !== null && y !== undefined) { low = Math.min(low, y); high = Math.max(high, y); }
        });
        return low > high ? `${line.label}: nothing` : `${line.label}: ${+low.toPrecision(4)} to ${+high.toPrecision(4)}`;
      });
      plot.text.textContent = `From ${+min.toPrecision(4)} to ${+max.toPrecision(4)} ${unit}: ${parts.join("; ")}`;
    };
    const show = (min, max) => {
      moving = true;
      for (const plot of plots) { plot.u.setScale("x", { min, max }); }
      moving = false;
      plots.forEach(stated);
      if (live && live.look) live.look(plots, min, max, renewed);
    };
    const renewed = (plot, min, max) => {
      moving = true;
      plot.u.setData(uPlot.join(plot.lines.map(({ one }) => curve(one))), false);
      plot.u.setScale("x", { min, max });
      moving = false;
      stated(plot);
      noted();
    };
    const change = (what) => {
      if (!plots.length) return;
      const { min, max } = plots[0].u.scales.x, log = over() !== "time";
      const [go, back] = log ? [Math.log, Math.exp] : [(x) => x, (x) => x];
      const ends = plots[0].ends.map(go);
      let [low, high] = [go(min), go(max)];
      const width = high - low, part = { in: [0.25, -0.25], out: [-0.5, 0.5], left: [-0.25, -0.25], right: [0.25, 0.25] }[what];
      [low, high] = part ? [low + part[0] * width, high + part[1] * width] : ends;
      if (low < ends[0]) { high = Math.min(high + ends[0] - low, ends[1]); low = ends[0]; }
      if (high > ends[1]) { low = Math.max(low - high + ends[1], ends[0]); high = ends[1]; }
      show(back(low), back(high));
    };
    const keys = { ArrowLeft: "left", ArrowRight: "right", "+": "in", "=": "in", "-": "out", "0": "all" };
    const plotted = (name, unit, lines) => {
      const box = made("div", "", { class: "plot", tabindex: 0, role: "group", "aria-describedby": "series-help" });
      const text = made("p", "", { class: "note" }), time = over() === "time";
      const title = `${name} [${time ? unit : `(${unit})²/Hz`}]`;
      box.setAttribute("aria-label", title);
      box.append(made("h3", title));
      at("series-plots").append(box);
      const value = (_, at) => (at === null || at === undefined ? "" : +at.toPrecision(5));
      const hues = ["--without", "--with", "--payload", "--link", "--warn", "--ink"];
      const series = lines.flatMap(({ run, one, label, hue }) => {
        const words = label || (run.label === run.name && run.name) || `${run.name}, ${run.balanced ? "with" : "without"} counter-masses`;
        const stroke = colour(hue === undefined ? (run.balanced ? "--with" : "--without") : hues[hue % hues.length]);
        const line = { label: words, stroke, value, width: 1, points: { show: false }, dash: run.again ? [6, 4] : undefined };
        return one.half_width ? [line, ...["from", "to"].map((end) => ({ label: end, width: 0, points: { show: false } }))] : [line];
      });
      const bands = series.flatMap((line, i) => (line.label === "to" && line.width === 0 ? [{ series: [i + 1, i], fill: colour("--band") }] : []));
      const axis = { stroke: colour("--ink"), grid: { stroke: colour("--line"), width: 1 }, ticks: { stroke: colour("--line") } };
      const u = new uPlot({
        width: box.clientWidth, height: 220, legend: { live: true },
        cursor: { sync: { key: "counterpoise" }, drag: { x: true, y: false } },
        scales: { x: { time: false, distr: time ? 1 : 3 }, y: { distr: time ? 1 : 3 } },
        axes: [{ ...axis, label: time ? data.time || "time [s]" : "frequency [Hz]", labelSize: 22 }, { ...axis, size: 70 }],
        series: [{ label: time ? "at [s]" : "at [Hz]", value }, ...series],
        bands,
        hooks: { setScale: [(self, key) => {
          if (key === "x" && !moving && plots.some((plot) => plot.u === self)) show(self.scales.x.min, self.scales.x.max);
        }] },
      }, uPlot.join(lines.map(({ one }) => curve(one))), box);
      box.append(text);
      const about = [...new Set(lines.map(({ one }) => one.note).filter((note) => note))];
      if (about.length) box.append(made("p", about.join("; "), { class: "note" }));
      box.addEventListener("keydown", (event) => {
        if (keys[event.key]) { event.preventDefault(); change(keys[event.key]); }
      });
      let grabbed = null;
      u.over.addEventListener("mousedown", (event) => {
        if (!event.shiftKey) return;
        event.stopImmediatePropagation();
        grabbed = { x: event.clientX, ...u.scales.x };
      }, true);
      u.over.addEventListener("mousemove", (event) => {
        if (!grabbed || !time) return;
        const off = (event.clientX - grabbed.x) / u.over.clientWidth * (grabbed.max - grabbed.min);
        show(grabbed.min - off, grabbed.max - off);
      });
      window.addEventListener("mouseup", () => { grabbed = null; });
      const all = u.data[0];
      return { u, box, text, lines, ends: [all[0], all[all.length - 1]] };
    };
    const redraw = async () => {
      const turn = ++turns, [first, second] = chosen();
      if (!first) return;
      first.again = false;
      if (second) second.again = second.balanced === first.balanced;
      const wanted = (one) => one.kind === kinds.value || one.name === kinds.value;
      const names = [...new Set(chosen().flatMap((run) => listed(run).filter(wanted).map((one) => one.name)))];
      let drawn = names.map((name) => ({
        name, lines: chosen().map((run, i, all) => ({
          run, one: listed(run).find((one) => wanted(one) && one.name === name), hue: all.length > 2 ? i : undefined,
        })).filter(({ one }) => one),
      }));
      if (live && live.load) drawn = await live.load(drawn, over(), plots.length ? plots[0].u.scales.x : null);
      if (turn !== turns) return;
      plots.forEach((plot) => plot.u.destroy());
      at("series-plots").replaceChildren();
      plots = [];
      drawn = drawn.map(({ name, lines }) => ({ name, lines: lines.filter(({ one }) => curve(one)[0].length) }));
      plots = drawn.filter(({ lines }) => lines.length).map(({ name, lines }) => plotted(name, lines[0].one.unit, lines));
      plots.forEach(stated);
      noted();
    };
    const noted = () => {
      const shown = plots.flatMap(({ lines }) => lines.map(({ one }) => one)), reduced = shown.filter((one) => !one.whole);
      const how = over() !== "time"
        ? "Power spectral density by Welch's method; of neighbouring lines the largest is drawn."
        : reduced.length
          ? `Of ${Math.max(...reduced.map((one) => one.samples))} samples the least and the largest of each `
            + `${(2000 * reduced[0].step).toPrecision(3)} ms are drawn: every peak is there, its place known to that. Values are rounded to 1/65534 of their range.`
          : "Every sample, not filtered; values are rounded to 1/65534 of their range.";
      at("series-note").textContent = [how, ...new Set(shown.map((one) => one.about).filter((text) => text))].join(" ");
    };
    /* The same runs with other values; ``anew`` where channels or instants are others. */
    renew = (fresh, anew) => {
      fresh.forEach((run, i) => (anew ? Object.assign(runs[i], run)
        : run.channels.forEach((one, k) => Object.assign(runs[i].channels[k], one, { curve: null }))));
      if (anew) { offer(); redraw(); } else plots.forEach((plot) => renewed(plot, plot.u.scales.x.min, plot.u.scales.x.max));
    };
    const pair = () => {
      const one = conditions[at("series-condition").value];
      at("series-a").value = one.first;
      at("series-b").value = one.second;
    };
    if (conditions.length) {
      pair();
      at("series-condition").addEventListener("change", () => { pair(); offer(); redraw(); });
    } else if (runs.length > 1) for (const one of at("series-b").options) one.selected = one.value === "1" || (data.together && one.value > 0);
    for (const id of ["series-a", "series-b", "series-over"]) at(id).addEventListener("change", () => { offer(); redraw(); });
    kinds.addEventListener("change", redraw);
    for (const button of document.querySelectorAll("[data-view]")) button.addEventListener("click", () => change(button.dataset.view));
    at("series-over").parentElement.hidden = !runs.some((run) => run.spectra.length);
    at("series-controls").hidden = help.hidden = false;
    offer();
    redraw();
    new ResizeObserver(() => plots.forEach(({ u, box }) => {
      if (box.clientWidth && u.width !== box.clientWidth) u.setSize({ width: box.clientWidth, height: 220 });
    })).observe(at("series-plots"));
    const recolour = () => {
      if (!plots.length) return;
      const { min, max } = plots[0].u.scales.x;
      redraw().then(() => show(min, max));
    };
    for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", recolour);
  }

  if (live && live.ready) live.ready({ pictured, show, renew });

  /* Tables that filter, details that print. */
  for (const input of document.querySelectorAll("input[data-filters]")) {
    const rows = at(input.dataset.filters).tBodies[0].rows;
    input.addEventListener("input", () => {
      const words = input.value.toLowerCase().split(/\s+/);
      for (const row of rows) row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
    });
    input.closest(".controls").hidden = false;
  }
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((one) => { one.open = true; }));
})();
