"use strict";
/* What the view of a mechanism adds to the page's script: its wishes are asked for as they change, the last one wins. */
window.live = ({ data, at, made, asked }) => ({
  ready({ pictured, show, renew }) {
    const angles = { azimuth: 30, elevation: 20 };
    const said = (error) => { at("view-error").textContent = error ? error.message : ""; };
    const ZERO = 1e-9;
    const digits = (value) => (value === null ? "–" : Math.abs(value) < ZERO ? "0" : value.toPrecision(4));

    /* A quantity: a slider, and a field that takes any unit. */
    const quantity = (host, { name, unit, low, high }, changed) => {
      const label = made("label"), field = made("input", "", { size: 14, "aria-label": `${name}, with unit` });
      const slider = made("input", "", { type: "range", min: low, max: high, step: (high - low) / 1000, "aria-label": name });
      label.append(made("bdi", name), slider, field);
      host.append(label);
      const set = (value) => {
        if (document.activeElement !== field) field.value = `${+value.toPrecision(9)} ${unit}`;
        slider.value = value;
        slider.setAttribute("aria-valuetext", `${+value.toPrecision(4)} ${unit}`);
      };
      slider.addEventListener("input", () => { field.value = `${+Number(slider.value).toPrecision(6)} ${unit}`; changed(); });
      field.addEventListener("change", () => { field.blur(); changed(); });
      return { set, text: () => field.value };
    };
    /* Asks anew until what was asked for last is shown. */
    const latest = (name, words, shown) => {
      let wanted = false, busy = false;
      return async () => {
        wanted = true;
        if (busy) return;
        busy = true;
        while (wanted) {
          wanted = false;
          await asked(name, words()).then((found) => { said(null); shown(found); }, said);
        }
        busy = false;
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
    const showValues = (found) => {
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
      masses.forEach((one, i) => one.set(found.masses_kg.mounted[i]));
    };
    const instants = (found) => JSON.stringify(found.runs[0].channels.map(({ name, start, step, samples }) => [name, start, step, samples]));
    const answered = (found) => {
      const anew = instants(found) !== instants(current);
      showValues(found);
      show(found.moving);
      renew(found.runs, anew);
    };
    const respond = latest("response", () => {
      const words = { motion: choice.value, ...(stroke.disabled ? {} : { stroke: stroke.value, peak: peak.value }), ...from() };
      return sized ? words : { ...words, ...mounted() };
    }, answered);
    const posed = ({ moving, at: values, centre_m: centre, beyond }) => {
      pictured(at("hand-panels"), moving)(0);
      coordinates.forEach((one, i) => one.set(values[i]));
      const place = centre.map((x, i) => `${"xyz"[i]} = ${+(1000 * x).toFixed(2)} mm`).join(", ");
      at("hand-now").textContent = [`Centre of mass: ${place}.`, ...beyond].join(" ");
    };
    const pose = latest("pose", () => ({
      ...Object.fromEntries(coordinates.map((one, i) => [`at${i}`, one.text()])), ...mounted(), ...from(),
    }), posed);
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
      const keys = { ArrowLeft: [-10, 0], ArrowRight: [10, 0], ArrowUp: [0, 10], ArrowDown: [0, -10] };
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
