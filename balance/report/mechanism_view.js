"use strict";
/* What the view of a mechanism adds to the page's script: its wishes are asked for as they change, the last one wins. */
window.live = ({ data, at, made, asked }) => ({
  ready({ pictured, show, renew }) {
    const angles = { azimuth: 30, elevation: 20 };
    const errors = {};
    const said = (name, error) => {
      errors[name] = error ? error.message : "";
      at("view-error").textContent = [...new Set(Object.values(errors))].filter(Boolean).join(" ");
    };
    const ZERO = 1e-9;
    const digits = (value) => (value === null ? "–" : Math.abs(value) < ZERO ? "0" : value.toPrecision(4));

    /* A quantity: a slider, and a field that takes any unit; the answer to an older text does not replace a newer one. */
    const quantity = (host, { name, unit, low, high }, changed) => {
      const label = made("label"), field = made("input", "", { size: 14, "aria-label": `${name}, with unit` });
      const slider = made("input", "", { type: "range", min: low, max: high, step: (high - low) / 1000, "aria-label": name });
      label.append(made("bdi", name), slider, field);
      host.append(label);
      const set = (value, asked = field.value) => {
        if (field.value !== asked) return;
        if (document.activeElement !== field) field.value = `${+value.toPrecision(9)} ${unit}`;
        slider.value = value;
        slider.setAttribute("aria-valuetext", `${+value.toPrecision(4)} ${unit}`);
      };
      slider.addEventListener("input", () => { field.value = `${+Number(slider.value).toPrecision(6)} ${unit}`; changed(); });
      field.addEventListener("change", () => { field.blur(); changed(); });
      return { set, text: () => field.value };
    };
    /* Asks anew until what was asked for last is shown. */
    const latest = (name, words, fields, shown) => {
      let wanted = false, busy = null;
      const ask = async () => {
        while (wanted) {
          wanted = false;
          const texts = fields().map((one) => one.text());
          await asked(name, words()).then((found) => { said(name); shown(found, texts); }, (error) => said(name, error));
        }
        busy = null;
      };
      return () => {
        wanted = true;
        busy = busy || ask();
        return busy;
      };
    };
    const from = () => ({ azimuth: `${angles.azimuth} deg`, elevation: `${angles.elevation} deg` });
    const choice = at("view-motion"), stroke = at("view-stroke"), peak = at("view-peak");
    const mounted = () => Object.fromEntries(masses.map((one, i) => [`mass${i}`, one.text()]));
    let current = data.response, sized = true;

    const number = (value) => {
      const cell = made("td"), one = made("data", digits(value), { value: JSON.stringify(value) });
      cell.append(one);
      return cell;
    };
    const showValues = (found, texts = []) => {
      current = found;
      const [without, best, here] = Object.values(found.rms_force_N);
      const share = (one) => (without > 0 ? `${digits(100 * one / without)} %` : "–");
      at("verdict").textContent = `Motion ${found.motion}: RMS shaking force ${digits(here)} N as mounted here, ${share(here)} of ${digits(without)} N without counter-masses; ${digits(best)} N (${share(best)}) as sized.`;
      at("view-about").textContent = found.about;
      at("view-rows").replaceChildren(...found.responses.map(({ component, unit, rms, peak: largest }) => {
        const row = made("tr"), head = made("th", `${component} [${unit}]`, { scope: "row" });
        row.append(head, ...[...rms, ...largest].map(number));
        return row;
      }));
      masses.forEach((one, i) => one.set(found.masses_kg.mounted[i], texts[i]));
    };
    const instants = (found) => JSON.stringify(found.runs[0].channels.map(({ name, start, step, samples }) => [name, start, step, samples]));
    const answered = (found, texts) => {
      const anew = instants(found) !== instants(current);
      showValues(found, texts);
      show(found.moving);
      renew(found.runs, anew);
    };
    const respond = latest("response", () => {
      const words = { motion: choice.value, ...(stroke.disabled ? {} : { stroke: stroke.value, peak: peak.value }), ...from() };
      return sized ? words : { ...words, ...mounted() };
    }, () => masses, answered);
    const hand = at("hand-panels");
    let drawn = data.pose.moving, drag = null;
    const posed = ({ moving, at: values, centre_m: centre, at_rest: torques, beyond }, texts = []) => {
      drawn = moving;
      pictured(hand, moving)(0);
      coordinates.forEach((one, i) => one.set(values[i], texts[i]));
      const place = centre.map((x, i) => `${"xyz"[i]} = ${+(1000 * x).toFixed(2)} mm`).join(", ");
      const drives = torques.map(([name, unit, value]) => `${name} ${digits(value)} ${unit}`).join(", ");
      at("hand-now").textContent = [`Centre of mass: ${place}.`, drives && `Held by: ${drives}.`, ...beyond].join(" ");
    };
    const pose = latest("pose", () => ({
      ...Object.fromEntries(coordinates.map((one, i) => [`at${i}`, one.text()])), ...mounted(), ...from(), ...pulled(),
    }), () => coordinates, posed);

    /* The drawing is dragged: a counter-mass to another mass, any other part to where the mechanism can bring it. */
    const NEAR = 40;
    const pointed = ({ clientX, clientY }) => new DOMPoint(clientX, clientY).matrixTransform(hand.querySelector("svg").getScreenCTM().inverse());
    const away = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);
    const corners = (k) => {
      const one = hand.querySelector("svg").children[k];
      return one.points ? [...one.points] : [{ x: one.cx.baseVal.value, y: one.cy.baseVal.value }];
    };
    const between = ({ k, i, j, share }) => {
      const a = corners(k)[i], b = corners(k)[j];
      return { x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y) };
    };
    const gripped = (pointer) => {
      let grip = null, best = NEAR;
      drawn.panels[0].shapes.forEach(({ kind }, k) => {
        if (!["link", "payload", "pivot"].includes(kind)) return;
        corners(k).forEach((a, i, all) => {
          const j = (i + 1) % all.length, b = all[j], square = away(a, b) ** 2;
          const along = square ? ((pointer.x - a.x) * (b.x - a.x) + (pointer.y - a.y) * (b.y - a.y)) / square : 0;
          const one = { k, i, j, share: Math.min(1, Math.max(0, along)) }, distance = away(pointer, between(one));
          if (distance < best) [grip, best] = [one, distance];
        });
      });
      return grip;
    };
    const pulled = () => {
      if (!drag || !drag.grip) return {};
      const { k, i, j, share } = drag.grip, points = drawn.panels[0].shapes[k].points;
      const here = between(drag.grip), to = pointed(drag), metre = drawn.scale_bar_m / drawn.scale_bar;
      const [right, up] = [(to.x - drag.lead.x - here.x) * metre, (here.y - to.y + drag.lead.y) * metre];
      return { grip0: points[i], grip1: points[j], share, right: `${right} m`, up: `${up} m` };
    };
    hand.addEventListener("pointerdown", (event) => {
      const { target, clientX, clientY, pointerId } = event, pointer = pointed(event);
      if (event.button) return;
      drag = { clientX, clientY };
      if (target.classList.contains("counter")) {
        drag.site = [...hand.querySelectorAll(".counter")].indexOf(target);
        drag.at = { x: target.cx.baseVal.value, y: target.cy.baseVal.value };
        drag.radius = Math.sqrt(Math.max(0, parseFloat(target.textContent)) / data.disc_kg_per_m2);
        drag.far = away(pointer, drag.at);
      } else {
        drag.grip = gripped(pointer);
        const here = drag.grip && between(drag.grip);
        drag = drag.grip && { ...drag, lead: { x: pointer.x - here.x, y: pointer.y - here.y } };
      }
      if (drag) hand.setPointerCapture(pointerId);
    });
    hand.addEventListener("pointermove", ({ clientX, clientY }) => {
      if (!drag) return;
      Object.assign(drag, { clientX, clientY });
      if (drag.grip) return void pose();
      const metre = drawn.scale_bar_m / drawn.scale_bar, radius = drag.radius + (away(pointed(drag), drag.at) - drag.far) * metre;
      const mass = data.disc_kg_per_m2 * Math.max(0, radius) ** 2;
      masses[drag.site].set(+Math.min(mass, data.masses[drag.site].high).toPrecision(3));
      both();
    });
    hand.addEventListener("lostpointercapture", () => {
      const mine = drag;
      if (mine) pose().then(() => { if (drag === mine) drag = null; });
    });
    const both = () => { sized = false; respond(); pose(); };
    const masses = data.masses.map((one) => quantity(at("view-masses"), one, both));
    const coordinates = data.coordinates.map((one) => quantity(at("view-coordinates"), one, pose));

    choice.append(...data.choices.map(({ name }, i) => made("option", name, { value: i })));
    const chosen = () => {
      const one = data.choices[choice.value];
      for (const [input, text] of [[stroke, one.stroke], [peak, one.peak]]) {
        input.disabled = !text;
        input.value = text || "as its file has it";
      }
    };
    chosen();
    choice.addEventListener("change", () => { chosen(); respond(); });
    for (const input of [stroke, peak]) input.addEventListener("change", respond);
    at("view-sets").hidden = !masses.length;
    for (const button of document.querySelectorAll("[data-set]")) {
      button.addEventListener("click", async () => {
        sized = button.dataset.set === "sized";
        if (!sized) masses.forEach((one) => one.set(0));
        await respond();
        pose();
      });
    }

    /* Of spatial mechanisms: from where they are seen. */
    if (!data.motions[0].flat) {
      const turned = () => { respond(); pose(); };
      at("view-from").hidden = false;
      at("view-side").addEventListener("change", ({ target }) => {
        [angles.azimuth, angles.elevation] = target.value.split(" ").map(Number);
        turned();
      });
      const keys = { ArrowLeft: [10, 0], ArrowRight: [-10, 0], ArrowUp: [0, 10], ArrowDown: [0, -10] };
      for (const host of [at("motion-panels"), at("hand-panels")]) {
        host.setAttribute("tabindex", "0");
        host.setAttribute("role", "group");
        host.setAttribute("aria-label", "Pictures; arrow keys turn the view");
        host.addEventListener("keydown", (event) => {
          if (!keys[event.key]) return;
          event.preventDefault();
          angles.azimuth += keys[event.key][0];
          angles.elevation = Math.max(-90, Math.min(90, angles.elevation + keys[event.key][1]));
          turned();
        });
      }
    }
    showValues(data.response);
    posed(data.pose);
    pose();
  },
});
