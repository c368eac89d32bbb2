"use strict";
(() => {
  const $ = (id) => document.getElementById(id);
  const data = JSON.parse($("data").textContent);
  const pictures = JSON.parse($("pictures").textContent);
  const here = new Set(pictures.here);
  document.documentElement.classList.add("js");
  const PAGE = 24;
  // The plot of a chart and the margin of a map, as the file has them.
  const PLOT = { left: 56, top: 10, width: 272, height: 196 }, MARGIN = 10;
  const runs = data.runs, state = { run: 0, only: null, shown: PAGE, found: [] };
  const short = (v) => {
    if (v === null || Number.isNaN(v)) return "not a number";
    const size = Math.abs(v);
    return size >= 1000 ? v.toFixed(0) : size >= 10 ? v.toFixed(1)
      : size >= 0.001 || size === 0 ? v.toFixed(3) : v.toExponential(1);
  };
  const element = (tag, text, className) => {
    const it = document.createElement(tag);
    if (text !== undefined) it.textContent = text;
    if (className) it.className = className;
    return it;
  };

  // Nothing turns the direction of the text around it.
  const plain = (text) => text.replace(/[\u202a-\u202e\u2066-\u2069]/g, "\ufffd");
  for (const run of runs) [run.name, run.by] = [plain(run.name), plain(run.by)];

  // Verdicts, per run.
  for (const run of runs) {
    run.right = run.ok ? run.ok.map((flags) => flags[0] === "1") : null;
    run.order = run.u.map((_, q) => q).filter((q) => run.u[q] !== null).sort((a, b) => run.u[a] - run.u[b]);
  }
  const accepts = (run, q) => run.u[q] !== null && run.u[q] <= run.th;
  const isRight = (run, q) => !run.right || run.right[q];

  // Filters.
  const control = (id) => $("f-" + id);
  runs.forEach((run, i) => control("run").add(new Option(run.name, i)));
  const fillOthers = () => {
    const other = control("other");
    while (other.options.length > 1) other.remove(1);
    runs.forEach((run, i) => {
      if (i === state.run || run.d !== runs[state.run].d || !run.right) return;
      other.add(new Option("right where " + run.name + " is wrong", i + "+"));
      other.add(new Option("wrong where " + run.name + " is right", i + "-"));
    });
  };
  const showCover = () => {
    const run = runs[state.run], n = run.u.length || 1;
    const accepted = run.order.filter((q) => run.u[q] <= run.th).length;
    control("cover").value = Math.round(accepted / n * 1000);
    control("covered").textContent = (accepted / n * 100).toFixed(1) + " %, at most " + short(run.th);
  };
  const filtered = () => {
    const run = runs[state.run], right = control("right").value, accept = control("accept").value;
    const low = parseFloat(control("low").value), high = parseFloat(control("high").value);
    const other = control("other").value, rival = other ? runs[parseInt(other, 10)] : null;
    const wins = other.endsWith("+"), found = [];
    for (let q = 0; q < run.u.length; q++) {
      if (state.only !== null && q !== state.only) continue;
      if (right !== "" && (!run.right || run.right[q] !== (right === "1"))) continue;
      if (accept !== "" && accepts(run, q) !== (accept === "1")) continue;
      const distance = run.s[q].length ? run.s[q][0] : null;
      if (!Number.isNaN(low) && !(distance !== null && distance >= low)) continue;
      if (!Number.isNaN(high) && !(distance !== null && distance <= high)) continue;
      if (rival && !(isRight(run, q) === wins && rival.right[q] === !wins)) continue;
      found.push(q);
    }
    return found;
  };

  // Curves of what the filters leave.
  const path = (svg, points) => {
    const x = svg.dataset.x.split(" ").map(Number), y = svg.dataset.y.split(" ").map(Number);
    return points.map(([a, b], i) => (i ? "L" : "M")
      + (PLOT.left + (a - x[0]) / (x[1] - x[0]) * PLOT.width).toFixed(1) + " "
      + (PLOT.top + (1 - (b - y[0]) / (y[1] - y[0])) * PLOT.height).toFixed(1)).join("");
  };
  const drawCurves = (found) => {
    const run = runs[state.run];
    if (!run.right) return;
    const kept = new Set(found), n = found.length;
    const order = run.order.filter((q) => kept.has(q)).concat(found.filter((q) => run.u[q] === null));
    const positives = found.filter((q) => run.right[q]).length, negatives = n - positives;
    const precision = [], roc = [[0, 0]], risk = [];
    let hits = 0;
    order.forEach((q, i) => {
      hits += run.right[q] ? 1 : 0;
      // Equal uncertainties enter together.
      if (i + 1 < order.length && run.u[order[i + 1]] === run.u[q]) return;
      const accepted = i + 1;
      if (positives) precision.push([hits / positives, hits / accepted]);
      if (positives && negatives) roc.push([(accepted - hits) / negatives, hits / positives]);
      risk.push([accepted / n, 1 - hits / accepted]);
    });
    const k = Math.max(0, ...run.p.slice(0, 50).map((list) => list.length)), recall = [];
    for (let rank = 1; rank <= k && n; rank++) {
      recall.push([rank, found.filter((q) => run.ok[q].slice(0, rank).includes("1")).length / n]);
    }
    const all = { "precision-recall": precision, roc, "risk-coverage": risk, "recall-at-n": recall };
    for (const [id, points] of Object.entries(all)) {
      const svg = $(id);
      if (svg) svg.querySelector(".chosen").setAttribute("d", path(svg, points));
    }
  };
  const drawCuts = () => {
    for (const cut of document.querySelectorAll(".cut")) {
      const svg = cut.ownerSVGElement, x = svg.dataset.x.split(" ").map(Number);
      const th = Math.min(Math.max(runs[cut.dataset.run].th, x[0]), x[1]);
      cut.setAttribute("d", path(svg, [[th, Number(svg.dataset.y.split(" ")[0])]]) + "V" + PLOT.top);
    }
  };

  // Maps.
  const place = (view, at, i) => {
    const a = at[view[0]][i], b = at[view[1]][i];
    if (a === null || b === null) return null;
    return [MARGIN + (a - view[2]) * view[4], view[5] - MARGIN - (b - view[3]) * view[4]];
  };
  const SHAPES = { wr: "m-3 0h6m-3 -3v6", rr: "h0", ra: "h0", wa: "m-3.5 -3.5l7 7m0 -7l-7 7" };
  const drawMaps = (found) => {
    const run = runs[state.run];
    for (const figure of document.querySelectorAll("figure[data-view]")) {
      const isShown = Number(figure.dataset.dataset) === run.d;
      figure.hidden = !isShown;
      if (!isShown) continue;
      const dataset = data.datasets[run.d], view = dataset.views[figure.dataset.view];
      const paths = { wr: [], rr: [], ra: [], wa: [] }, threads = [];
      for (const q of found) {
        const at = place(view, dataset.qp, q);
        if (!at) continue;
        const kind = (isRight(run, q) ? "r" : "w") + (accepts(run, q) ? "a" : "r");
        paths[kind].push("M" + at[0].toFixed(1) + " " + at[1].toFixed(1) + SHAPES[kind]);
        const to = found.length <= 500 && run.p[q].length ? place(view, dataset.rp, run.p[q][0]) : null;
        if (to) threads.push("M" + at[0].toFixed(1) + " " + at[1].toFixed(1) + "L" + to[0].toFixed(1) + " " + to[1].toFixed(1));
      }
      for (const [kind, list] of Object.entries(paths)) {
        for (const it of figure.querySelectorAll("." + kind)) it.setAttribute("d", list.join(""));
      }
      figure.querySelector(".thread").setAttribute("d", threads.join(""));
      figure.querySelector(".who").textContent = run.name + ", " + found.length + " queries";
    }
  };
  for (const figure of document.querySelectorAll("figure[data-view]")) {
    const svg = figure.querySelector("svg");
    svg.addEventListener("click", (event) => {
      const matrix = svg.getScreenCTM();
      if (!matrix) return;
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse());
      const dataset = data.datasets[runs[state.run].d], view = dataset.views[figure.dataset.view];
      let nearest = null, least = 144;
      for (const q of filtered()) {
        const at = place(view, dataset.qp, q);
        const far = at ? (at[0] - point.x) ** 2 + (at[1] - point.y) ** 2 : Infinity;
        if (far < least) [nearest, least] = [q, far];
      }
      if (nearest === null) return;
      state.only = nearest;
      update();
      $("gallery").scrollIntoView({ behavior: "smooth" });
    });
  }

  // The gallery.
  const picture = (kind, set, side, i, caption) => {
    const dataset = data.datasets[set], name = plain(dataset[side + "0"] + dataset[side][i]);
    const id = side + set + "-" + i, figure = element("figure", undefined, kind);
    const image = element("div", undefined, "im " + id);
    image.setAttribute("role", "img");
    image.setAttribute("aria-label", name);
    if (!here.has(id)) image.append(element("i", id in pictures.bad ? "cannot be read: " + plain(pictures.bad[id]) : "no picture here"));
    const text = element("figcaption", caption), small = element("small"), letters = [...name];
    small.title = name;
    small.append(element("bdi", letters.length > 24 ? "…" + letters.slice(-23).join("") : name));
    text.append(element("br"), small);
    figure.append(image, text);
    return figure;
  };
  const card = (q) => {
    const run = runs[state.run], it = element("article", undefined, "card"), head = element("h3", run.name + ": ");
    head.append(element("b", run.right ? (run.right[q] ? "✓ right" : "✗ wrong") : "not judged"),
      accepts(run, q) ? ", accepted" : ", rejected");
    const reason = run.u[q] === null ? "not a number" : short(run.u[q]) + (accepts(run, q) ? " ≤ " : " > ") + short(run.th);
    const row = element("div", undefined, "row");
    row.append(picture("query", run.d, "q", q, "query " + q));
    run.p[q].forEach((r, rank) => {
      const ok = run.ok ? run.ok[q][rank] === "1" : null, inliers = run.n && run.n[q][rank] !== null ? ", " + run.n[q][rank] + " inliers" : "";
      row.append(picture(ok === null ? "query" : ok ? "right" : "wrong", run.d, "r", r,
        (ok === null ? "" : ok ? "✓ " : "✗ ") + short(run.s[q][rank]) + inliers));
    });
    const truth = data.datasets[run.d].t ? data.datasets[run.d].t[q] : -1;
    if (truth >= 0 && run.ok && !run.ok[q].includes("1")) row.append(picture("right", run.d, "r", truth, "truth"));
    it.append(head, element("p", run.by + ": " + reason), row);
    return it;
  };
  const drawCards = () => {
    const cards = $("cards");
    cards.replaceChildren(...state.found.slice(0, state.shown).map(card));
    $("more").hidden = state.found.length <= state.shown;
    $("shown").textContent = Math.min(state.shown, state.found.length) + " of " + state.found.length + " queries; those with pictures first.";
  };
  $("more").addEventListener("click", () => { state.shown += PAGE; drawCards(); });

  const update = () => {
    const run = runs[state.run], found = filtered();
    const has = (q) => here.has("q" + run.d + "-" + q) ? 0 : 1;
    // The most certain of the wrong first, then the least certain of the right.
    const kind = (q) => isRight(run, q) ? (accepts(run, q) ? 3 : 1) : (accepts(run, q) ? 0 : 2);
    const key = (q) => (run.u[q] === null ? 1e300 : run.u[q]) * (isRight(run, q) ? -1 : 1);
    state.found = found.map((q) => [has(q), kind(q), key(q), q])
      .sort((a, b) => a[0] - b[0] || a[1] - b[1] || a[2] - b[2] || a[3] - b[3]).map((it) => it[3]);
    state.shown = PAGE;
    const right = run.right ? ", " + found.filter((q) => run.right[q]).length + " of them right" : "";
    const accepted = found.filter((q) => accepts(run, q)).length;
    $("count").textContent = found.length + " of " + run.u.length + " queries" + right + ", " + accepted + " accepted";
    drawCurves(found);
    drawMaps(found);
    drawCuts();
    drawCards();
  };
  if (runs.length) {
    $("filters").addEventListener("submit", (event) => event.preventDefault());
    $("filters").addEventListener("input", (event) => {
      state.only = null;
      if (event.target.id === "f-run") {
        state.run = Number(event.target.value);
        fillOthers();
        showCover();
      } else if (event.target.id === "f-cover") {
        const run = runs[state.run], n = Math.round(event.target.value / 1000 * run.u.length);
        run.th = n ? run.u[run.order[Math.min(n, run.order.length) - 1]] ?? -Infinity : -Infinity;
        const share = run.order.filter((q) => run.u[q] <= run.th).length / (run.u.length || 1);
        control("covered").textContent = (share * 100).toFixed(1) + " %, at most " + (n ? short(run.th) : "nothing");
      }
      update();
    });
    const choose = (preset) => {
      state.only = null;
      control("right").value = preset ? (preset[0] === "r" ? "1" : "0") : "";
      control("accept").value = preset ? (preset[1] === "a" ? "1" : "0") : "";
      for (const id of ["low", "high", "other"]) control(id).value = "";
      update();
    };
    for (const button of document.querySelectorAll("[data-preset]")) {
      button.addEventListener("click", () => choose(button.dataset.preset));
    }
    fillOthers();
    showCover();
    // `report.html#wa` opens with the wrong and accepted ones, and so on.
    const asked = location.hash.slice(1);
    choose(["wa", "wr", "ra", "rr"].includes(asked) ? asked : "");
  }

  // Values under the pointer.
  for (const svg of document.querySelectorAll(".chart svg[data-x]")) {
    const values = svg.parentElement.querySelector(".values"), cursor = svg.querySelector(".cursor");
    const x = svg.dataset.x.split(" ").map(Number), y = svg.dataset.y.split(" ").map(Number);
    const points = (line) => line.points ??= [...line.getAttribute("d").matchAll(/[ML]([\d.-]+) ([\d.-]+)/g)]
      .map((it) => [Number(it[1]), Number(it[2])]);
    svg.addEventListener("pointermove", (event) => {
      const matrix = svg.getScreenCTM();
      if (!matrix) return;
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse()).x;
      if (at < PLOT.left || at > PLOT.left + PLOT.width) return;
      cursor.setAttribute("d", "M" + at.toFixed(1) + " " + PLOT.top + "v" + PLOT.height);
      const lines = [];
      for (const line of svg.querySelectorAll("path.line[data-name]")) {
        const all = points(line);
        if (!all.length) continue;
        const near = all.reduce((a, b) => Math.abs(b[0] - at) < Math.abs(a[0] - at) ? b : a);
        const value = y[0] + (1 - (near[1] - PLOT.top) / PLOT.height) * (y[1] - y[0]);
        const where = x[0] + (near[0] - PLOT.left) / PLOT.width * (x[1] - x[0]);
        lines.push(line.dataset.name + ": " + short(value) + " at " + short(where));
      }
      values.textContent = lines.join("\n");
    });
    svg.addEventListener("pointerleave", () => { values.textContent = ""; cursor.setAttribute("d", ""); });
  }
})();
