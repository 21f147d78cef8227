// The page of `kiln bench`: `bench` is its JSON.
const bench = json("bench"), rows = bench.rows.filter((row) => row.skipped_reason == null);
const LIBRARIES = ["kiln", "obvhs", "bvh", "parry3d", "tinybvh", "embree"];
const KINDS = [
  ["primary", "Primary rays", "From a camera through the pixels of a picture, tile by tile: the closest hit."],
  ["shadow", "Shadow rays", "From what those hit to a point light, in the same order: whether anything is in the way."],
  ["diffuse", "Diffuse rays", "From what those hit, cosine-distributed about the normal: the closest hit."],
  ["random", "Random rays", "From a random point of the bounds towards another: the closest hit."],
];
const nameOf = (row) => [row.engine, row.layout, row.tier, row.preset].filter(Boolean).join(" ");
const three = (x) => (x == null ? undefined : x >= 99.95 ? Math.round(x).toLocaleString("en") : x.toFixed(x >= 9.995 ? 1 : 2));

// Horizontal bars of rows, each with a line from the lower to the upper quartile; names stand above them where it is narrow.
const bars = (unit, valueOf, wrongOf) => (width) => {
  const drawn = rows.filter(valueOf), isNarrow = width < 600, [left, pitch] = isNarrow ? [4, 40] : [280, 22];
  const bottom = 8 + pitch * drawn.length, end = 1.3 * Math.max(...drawn.map((row) => valueOf(row).upper));
  const x = (value) => left + ((width - 8 - left) * value) / end;
  const step = ROUND.find((round) => (end / round) * 60 <= width - left);
  const ticks = Array.from({ length: Math.floor(end / step) + 1 }, (_, i) => Number((i * step).toPrecision(6)));
  const bar = (row, i) => {
    const { lower, median, upper } = valueOf(row), middle = 8 + pitch * (i + 1) - 11, wrong = wrongOf(row);
    return html`<rect x="${left}" y="${middle - 7}" width="${x(median) - left}" height="14" fill="${colour(LIBRARIES.indexOf(row.engine))}"/>
<path class="ink" stroke-width="2" d="M${x(lower)} ${middle}H${x(upper)}"/>${isNarrow ? at(left, middle - 12, nameOf(row)) : at(left - 8, middle + 4, nameOf(row), END)}
${at(x(upper) + 8, middle + 4, three(median))}${wrong > 0 ? at(x(upper) + 56, middle + 4, `✗ ${wrong} wrong`, html` class="bad"`) : ""}`;
  };
  return [bottom + 44, html`${ticks.map((tick) => html`<path class="grid" d="M${x(tick)} 8V${bottom}"/>${at(x(tick), bottom + 15, tick, MIDDLE)}`)}
${drawn.map(bar)}<path class="ink" d="M${left} 8V${bottom}"/>${at((left + width) / 2, bottom + 36, unit, MIDDLE)}`];
};

const plot = (id) => html`<div id="${id}" data-width="900"></div>`;
const first = rows[0];
const row = (row) => {
  const tests = row.tests_per_ray.primary, wrong = row.wrong_hits ?? 0;
  return [row.engine, row.layout, row.tier, row.preset, row.isa, three(row.build_ms.median), row.nodes, row.depth, three(row.sah_cost),
    three(row.bytes_per_triangle), tests && `${three(tests.nodes)} + ${three(tests.primitives)}`,
    ...KINDS.map(([kind]) => three(row.mrays_per_s[kind]?.median)), wrong > 0 ? html`<td class="bad">${wrong}</td>` : 0];
};
document.title = `kiln bench: ${bench.subject}`;
draw(html`<h1>${document.title}</h1>${first ? html`<p>${first.triangles} triangles; kiln ${bench.kiln}; ${Object.fromEntries(bench.machine).processor}; ${first.threads} thread(s),
timed by ${first.clock} time; ${first.runs} round(s) in which all take turns, after one to warm up. Bars are medians, the thin lines reach from the lower to
the upper quartile. Compare within this page only.</p>` : ""}
${KINDS.map(([kind, heading, about]) => html`<h2>${heading}</h2><p class="note">${about} ${first?.rays[kind]} rays.</p>${plot(kind)}`)}
<h2>Building</h2><p class="note">From triangles in memory to ready for rays.</p>${plot("building")}
<h2>Numbers</h2><p class="note">Wrong: answers that differ from those of exact arithmetic. SAH: inner nodes entered and primitives tested by a random line
through the bounds, on average. Tests: boxes + primitives of a primary ray, on average. Speeds: million rays a second.</p>
${table(`<engine|<layout|<tier|<preset|<isa|build ms|nodes|depth|SAH|B/triangle|tests|${KINDS.map(([kind]) => kind).join("|")}|wrong`, rows.map(row))}
${bench.rows.filter((row) => row.skipped_reason != null).map((row) => html`<p>${row.engine}: not measured: ${row.skipped_reason}</p>`)}
<p>Command:</p><pre>${bench.command}</pre>`);
for (const [kind] of KINDS) {
  plotted(`#${kind}`, bars("million rays a second (longer is better)", (row) => row.mrays_per_s[kind], (row) => row.wrong_hits_by_kind[kind]));
}
plotted("#building", bars("milliseconds (shorter is better)", (row) => row.build_ms, () => 0));
