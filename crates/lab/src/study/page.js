// The page of a study: `study` is study.json, `pictures` the files that its rows show.
const study = json("study"), pictures = json("pictures"), { rows, size } = study;
const CROP = 64, ENLARGED = 25;

const nameOf = (row) => `${row.parameter}: ${row.setting}`;
const errorsOf = (row) => (row.reference === "limit" ? row.limit : row.twin);
const reference = (row) => (row.reference === "limit" ? "limit" : "exact, same samples");
const number = (x) => {
  if (x == null) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  return size >= 0.01 && size < 1e4 ? x.toFixed(size < 1 ? 3 : size < 100 ? 2 : 0) : x.toExponential(1).replace("+", "");
};
const steps = (x) => number(x == null ? x : 255 * x);
const percent = (share) => (share === 0 ? "0 %" : `${significant(100 * share, 2)} %`);
const inSteps = (error) => `${percent(error.beyond_step)} (${error.largest === 0 ? "0" : significant(error.largest, 2)})`;
// As many digits as the quartiles allow, at most three.
const ratio = ({ lower, median, upper }) => {
  const spread = Math.max(upper - lower, median / 1000) / 2;
  return significant(median, Math.min(3, Math.max(1, 1 + Math.floor(Math.log10(median / spread)))));
};
const ms = ({ lower, median, upper }) => {
  const [a, b, c] = [median, lower, upper].map((x) => x.toFixed(median < 10 ? 2 : median < 100 ? 1 : 0));
  return `${a} (${b} to ${c})`;
};
const command = (words) => (words ? html`<code class="command">${words}</code>` : "");

const costs = () => study.errors.length && html`<h2>What each error costs</h2>
<p class="note">Error: the pixels that are off by more than one step of 255 in a channel, and in brackets the largest difference in steps, of
displayed values before rounding. Time: with the option, relative to the picture. <code>kiln explain --measure</code> prints the same table.</p>
<div class="errors">${table("<cause|error|<type|error then|time|<", study.errors.map((error) => [error.cause, inSteps(error.now),
    error.options.split(/ (?=--)/).map((option) => html`<code>${option}</code> `), inSteps(error.then), `× ${ratio(error.time)}`, error.note]))}</div>`;

// A picture, or the square of its pixels around a place.
const picture = (file, alt) => html`<img class="pixels" src="${pictures.files[file]}" alt="${alt}">`;
const cornerOf = (place, side) => place.map((at, axis) => Math.max(0, Math.min(at - (side >> 1), size[axis] - side)));
const crop = (file, place, side, label) => {
  const box = [...cornerOf(place, side), ...size.map((all) => Math.min(all, side))];
  const image = html`<image href="${pictures.files[file]}" width="${size[0]}" height="${size[1]}"/>`;
  return html`<svg class="pixels" viewBox="${box.join(" ")}" role="img" aria-label="${label}"><title>around column ${place[0]},
row ${place[1]}</title>${image}</svg>`;
};

const selection = () => {
  const { place, limit } = pictures, chosen = study.selection;
  if (!place || !chosen || limit == null) return "";
  const [left, top] = cornerOf(place, CROP).map((at, axis) => (100 * at) / size[axis]);
  const [width, height] = size.map((side) => (100 * Math.min(CROP, side)) / side);
  const figure = (title, file, what, numbers, words) => html`<figure>${crop(file, place, CROP, title)}<figcaption><b>${title}</b>:
${what}<br>${numbers}${command(words)}</figcaption></figure>`;
  const ofRow = (title, id) => {
    const row = rows[id], file = pictures.rows[id]?.own;
    if (file == null) return "";
    const { rmse, flip, beyond_step } = row.limit;
    const numbers = `${ms(row.trace_ms)} ms; RMS error ${steps(rmse)} steps, FLIP ${number(flip)}; ${percent(beyond_step)} of the
pixels are off by more than a step`;
    return figure(title, file, nameOf(row), numbers, study.commands[id]);
  };
  const { quick, recommended, is_below_a_step } = chosen, floor = study.floors[0];
  const ofLimit = `${study.limit_ms?.toFixed(0)} ms; RMS noise ${steps(floor?.rmse)} steps`;
  const why = is_below_a_step ? "the fastest with an RMS error below one step of 255" : "the most accurate that was measured";
  const square = html`<span style="left:${left}%;top:${top}%;width:${width}%;height:${height}%"></span>`;
  return html`<div class="three four"><figure class="whole"><div>${picture(limit, "the converged picture")}${square}</div>
<figcaption>The converged picture. The square is enlarged in the next pictures: there the quick picture differs most.</figcaption></figure>
${ofRow("Quick", quick)}${recommended === quick ? "" : ofRow("Recommended", recommended)}
${figure("Limit", limit, `exact, ${floor?.samples} samples`, ofLimit, study.limit_command)}</div>
<p class="note">Quick: the fastest setting. Recommended: ${why}.
Limit: the converged picture. Times: median (and quartiles).</p>`;
};

// The tier that differs most from exact decisions.
const tier = () => {
  const worst = rows.filter((row) => row.parameter === "numerics" && pictures.rows[row.id]?.heat != null)
    .sort((a, b) => b.twin.beyond_step - a.twin.beyond_step || b.twin.max - a.twin.max)[0];
  if (!worst) return "";
  const largest = significant(255 * worst.twin.max, 2);
  if (worst.twin.beyond_step === 0) {
    return html`<h2>What the tier changes</h2><p>No pixel by more than one step of 255: the largest difference to exact decisions is ${largest} steps
(<code>${worst.setting}</code>). In the scenes of <code>scenes/hard</code> it is larger.</p>`;
  }
  const { own, reference, heat, worst: places } = pictures.rows[worst.id];
  const figures = [["Before", own, `numerics: ${worst.setting}`], ["After", reference, "exact decisions, same samples"],
    ["Where", heat, "the difference, brighter where larger"]];
  return html`<h2>What the tier changes</h2><p class="note"><code>${worst.setting}</code> is off by more than one step of
255 in ${percent(worst.twin.beyond_step)} of the pixels, by up to ${largest} steps. The worst place is enlarged below the pictures.</p>
<div class="three">${figures.map(([title, file, what]) =>
    html`<figure>${picture(file, title)}<figcaption><b>${title}</b>: ${what}</figcaption></figure>`)}
${figures.map(([title, file]) => html`<figure>${crop(file, places[0], ENLARGED, `${title}, enlarged`)}</figure>`)}</div>`;
};

const plot = (id, title, caption) =>
  html`<figure><div id="${id}" data-width="620"></div><figcaption><b>${title}</b> ${caption}</figcaption></figure>`;
const PATHS = ["path bounces", "indirect light", "roulette", "clamp", "light technique", "light samples"];
const tracesPaths = rows.some((row) => PATHS.includes(row.parameter));
const plots = () => html`<h2>Error against time</h2><div class="two">${plot("limit", "Against the limit, the converged picture.",
    `Filled, joined by the line: no setting is better in time and error (Pareto front). Hollow: another is. Strokes: quartiles; times
whose quartiles overlap are ties, and so are errors that differ by less than the noise of the limit. Not drawn: settings with an effect turned off,
which are different pictures, and acceleration structures, which give the same picture.`)}
${plot("twin", "One parameter alone, against exact decisions at the same sample points.", "On the line 0 no pixel differs.")}
${plot("paths", "Samples and the settings of path tracing.",
    "The error of each pixel relative to its own value, so that visible lights and their edges do not dominate.")}</div>`;

const advice = () => {
  const none = ["No setting was measured against the limit, so there are no recommendations."];
  const lines = [...(study.advice.length ? study.advice.map((advice) => advice.text) : none), ...study.facts];
  return html`<h2>Recommendations and differences</h2><ul>${lines.map((line) => html`<li>${coded(line)}</li>`)}</ul>`;
};

const marked = (value, isBad) => html`<td${isBad ? html` class="bad"` : ""}>${value}</td>`;
const geometry = () => {
  const row = (tier) => {
    const million = (count) => marked(number((count * 1e6) / Math.max(tier.rays, 1)), count > 0);
    const three = (values) => values?.map(number).join(" / ");
    const leaks = tier.leaks_per_million;
    const counts = [tier.false_hits, tier.false_misses, tier.wrong_primitives, tier.non_finite].map(million);
    return [tier.numerics, ...counts, leaks == null ? "no closed mesh" : marked(number(leaks), leaks > 0),
      three(tier.t_ulps), three(tier.normal_degrees)];
  };
  return html`<h2>Geometry</h2><p class="note">Camera rays of each tier against <code>exact</code>, before shading. Counts are per million rays. Leaks: rays from
inside closed meshes, aimed at edges and vertices, that hit nothing; camera rays seldom meet an edge exactly, so a tier can leak without a false miss.
Errors of t in ulps of f32 and of normals in degrees: median, 99.9 % quantile, maximum.</p>
${table("<tier|false hits|false misses|wrong primitive|not finite|leaks|t error, ulp|normals, °", study.geometry.map(row))}`;
};

// Bars of p-values; half the height is the expected count, the full height twice that and more.
const histogram = ({ histogram, tested }) => html`<svg width="${6 * histogram.length}" height="28">${histogram.map((count, bin) => {
  const height = 14 * Math.min(2, (count * histogram.length) / Math.max(tested, 1));
  return html`<rect x="${6 * bin}" y="${28 - height}" width="5" height="${height}" fill="${colour(5)}"/>`;
})}<path class="ink" d="M0 14H${6 * histogram.length}" stroke-dasharray="3 3"/></svg>`;
const techniques = () => {
  const tests = study.technique_tests ?? [];
  const cells = (test) => test.channels.map((channel) => [test.name, channel.channel, channel.tested, number(channel.difference),
    number(channel.standard_error), number(channel.equal_means), number(channel.uniform), histogram(channel),
    test.passed ? "no difference" : html`<td class="left bad">different</td>`]);
  return tests.length && html`<h2>Do the techniques agree?</h2><p class="note">BSDF samples and samples of lights against both by multiple importance
sampling: Welch’s t-test of blocks of ${tests[0].block} × ${tests[0].block} pixels, ${tests[0].samples} samples a pixel. If both converge to the same picture,
the p-values are even; the dashed line is what is expected of a bin. The control, two seeds of one technique, comes first: what bends its histogram is
no bias. Where a technique rarely finds a light, means and variances are too small together, and the histogram bends until there are enough samples.</p>
${table("<against both|<channel|blocks|difference of means|its standard error|p of equal means|p of an even histogram|\
<p-values from 0 to 1|<result", tests.flatMap(cells))}`;
};

const stepsOfParameters = () => {
  const row = (step) => {
    const [from, to] = [rows[step.from], rows[step.to]], { error_before: before, error_after: after } = step;
    const error = (error) => (step.is_relative && error != null ? `${number(error)} relMSE` : steps(error));
    const gain = () => {
      if (from.fingerprint === to.fingerprint) return "same picture";
      if (!before || after == null) return "";
      if (after === 0) return "no error";
      return before >= after ? `error ÷ ${number(before / after)}` : `error × ${number(after / before)}`;
    };
    const time = step.time_is_significant ? `× ${ratio(step.time_ratio)}` : "equal";
    return [step.parameter, from.setting, to.setting, time, error(before), error(after), gain()];
  };
  const meaning = (parameter) => coded(parameter in study.meanings ? ` (${study.meanings[parameter]})` : "");
  const omitted = study.left_out.map(([parameter, why]) => html`<li>${parameter}${meaning(parameter)}: ${coded(why)}</li>`);
  return html`<h2>What the next step costs and gains</h2><p class="note">Along each parameter, from one setting to the next. Errors: RMS, in steps of 255.
Times that differ by no more than their quartiles are equal.</p>
${table("<parameter|<from|<to|time|error before|error after|<gain", study.steps.map(row))}
${omitted.length ? html`<h3>Parameters without effect on this scene</h3><ul>${omitted}</ul>` : ""}`;
};

const shown = rows.filter((row) => pictures.rows[row.id]);
const viewer = () => shown.length && html`<h2 id="look">Pictures</h2>
<p><label>Setting <select id="choice">${shown.map((row) => html`<option value="${row.id}">${nameOf(row)}</option>`)}</select></label></p>
${shown.length < rows.length ? html`<p class="note">Pictures of ${rows.length - shown.length} settings are left out, to keep the page small.</p>` : ""}
<div class="two"><figure><div class="slider" tabindex="0" role="slider" aria-label="reference against setting" aria-valuemin="0" aria-valuemax="100"><img
class="pixels own" alt="the picture of this setting"><img class="pixels reference" alt="the reference"><span class="a"></span><span
class="b"></span></div><figcaption>Left: reference, right: setting. Drag, or use the arrow keys.<span id="command"></span></figcaption></figure>
<figure><div id="heat"><img class="pixels" alt="difference of the two pictures"><div class="scale"></div><div
class="ends"><span>10⁻⁸</span><span>10⁻⁶</span><span>10⁻⁴</span><span>10⁻²</span><span>1</span></div></div><p id="nothing" class="same">No pixel
differs.</p><figcaption>Difference to the reference: the maximum over the channels of each displayed pixel, on a logarithmic scale; 1 is
white.</figcaption></figure></div>
<div id="worst"><h3>Largest differences, enlarged</h3><div class="crops"></div></div>`;

const settings = () => {
  const row = (row) => {
    const errors = errorsOf(row), all = (style, text) => [html`<td colspan="6"${style && html` class="${style}"`}>${text}</td>`];
    let cells;
    if (row.non_finite > 0) cells = all("bad", `${row.non_finite} pixels are not finite`);
    else if (!errors) cells = all("", "–");
    else if (errors.max === 0) cells = all("same", "same picture: error 0");
    else {
      const { rmse, max, psnr, rel_mse, flip, beyond_step } = errors;
      cells = [steps(rmse), steps(max), psnr?.toFixed(1), number(rel_mse), number(flip), percent(beyond_step)];
    }
    const noisy = (error) => html`<span class="insignificant" title="not significant beside the noise of the reference">≈ ${error}</span>`;
    const limit = row.limit && (row.significance === "insignificant" ? noisy : (error) => error)(steps(row.limit.rmse));
    const style = study.front.includes(row.id) ? "front" : study.compared.includes(row.id) ? "dominated" : "";
    const first = [nameOf(row), number(row.build_ms.median), ms(row.trace_ms), row.samples_per_pixel.toFixed(1)];
    const attributes = html` class="${style}" data-row="${row.id}"`;
    return Object.assign([...first, row.reference === "limit" ? "limit" : "exact", ...cells, limit], { attributes });
  };
  return html`<h2>All settings</h2><p class="note">● on the Pareto front of time and error against the limit, ○ dominated or tied. No mark: another filter,
which has another limit, acceleration structures, and settings with an effect turned off. Errors: against the limit, or against <code>exact</code> at the same
sample points; RMS and max in steps of 255. A row shows its picture when it is clicked.</p>
${table("<setting|build ms|picture ms|samples a pixel|<against|RMS|max|PSNR dB|relMSE|FLIP|beyond a step|RMS to limit", rows.map(row))}
<p class="note">≈: less than ten times the reference’s own error; the true one may be anything up to about that. study.csv and study.json beside this page
have these numbers and more, of RMS and max with 1 for white.</p>`;
};

const measured = () => {
  const facts = [...study.machine, ...study.settings, ...(study.load_ms ? [["reading the inputs", `${ms(study.load_ms)} ms`]] : [])];
  const paths = (bounces) => (bounces ? `, at most ${bounces} bounces, without a clamp of indirect light` : "");
  const limit = ({ filter, samples, rmse, bounces }) => html`<li>Limit for the filter ${filter}: <code>exact</code>, ${samples} samples
per pixel${paths(bounces)}. Its RMS noise is ${steps(rmse)} steps: half the difference of its two halves, which have different seeds.</li>`;
  return html`<h2>How this was measured</h2><dl>${facts.map(([name, value]) => html`<dt>${name}</dt><dd>${value}</dd>`)}</dl>
<p>Command:</p><pre>${study.command}</pre>
<p>Pixels are checked to be finite first. Errors have no spread: equal settings give equal bits. Times are medians of all rounds with quartiles in brackets,
of rendering alone, without reading files, building, planning and writing.</p><ul>${study.floors.map(limit)}</ul>`;
};

document.title = `What accuracy costs: ${study.subject}`;
draw(html`<h1>${document.title}</h1><p class="lead">${coded(study.headline)}</p>
<p class="note">${size[0]} × ${size[1]} pixels; ${study.threads} thread(s); ${study.clock} time; ${study.rounds} round(s) with all settings in turn, after a
warm-up round. kiln ${study.kiln}.</p>
${[costs(), selection(), tier()].map((part) => part || "")}
<h2>Measures</h2><p class="note">On this page rmse and max are in steps of 255.</p><dl>${study.definitions.map(([name, meaning]) => html`<dt>${name}</dt><dd>${meaning}</dd>`)}</dl>
${[plots(), advice(), geometry(), techniques(), stepsOfParameters(), viewer(), settings(), measured()].map((part) => part || "")}`);

// A scatter plot of rows on logarithmic axes, with the names of those that `isLabelled`, as far as there is room.
const scatter = (points, { joined = [], floor, title, isLabelled }) => (width) => {
  const parameters = [...new Set(rows.map((row) => row.parameter))];
  const own = parameters.filter((name) => points.some((point) => point.row.parameter === name));
  const columns = Math.max(1, Math.floor((width - 20) / 150)), bottom = 400 - 46, edges = [56, 22, width - 8, bottom];
  const decades = (numbers) => {
    const low = ROUND.findLast((round) => round <= Math.min(...numbers) * 1.001);
    const high = ROUND.find((round) => round >= Math.max(...numbers) * 0.999);
    return [low, Math.max(high, 2 * low)];
  };
  const positive = [...points.map(({ y }) => y), floor ?? 0].filter((y) => y > 0), hasZero = points.some(({ y }) => y === 0);
  const [low, high] = positive.length ? decades(positive) : [0.1, 1], zero = hasZero ? low / Math.sqrt(10) : 0;
  const x = decades(points.flatMap(({ time }) => [time.lower, time.upper])), y = [hasZero ? zero / 1.5 : low, high * 1.6];
  x[1] *= 1.6;
  const share = (value, [low, high]) => Math.log(value / low) / Math.log(high / low);
  const place = (time, error) => {
    const [right, up] = [share(time, x), share(error > 0 ? error : zero, y)];
    return [edges[0] + (edges[2] - edges[0]) * right, bottom - (bottom - edges[1]) * up];
  };
  const ticks = ([low, high], most) => {
    const all = ROUND.filter((round) => round >= low * 0.999 && round <= high * 1.001);
    const tens = all.filter((round) => round.toExponential()[0] === "1");
    const few = all.length > most ? tens : all;
    return few.filter((_, i) => i % Math.ceil(few.length / most) === 0);
  };
  const label = (value) => {
    if (value === 0 || (value >= 1e-3 && value < 1e5)) return String(value);
    const [digit, power] = value.toExponential().replace("+", "").split("e");
    const raised = [...power].map((c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]).join("");
    return `${digit === "1" ? "" : `${digit}·`}10${raised}`;
  };
  const mark = ([x, y], group, isFilled, tip) => {
    const paint = html` fill="${isFilled ? colour(group % 6) : "none"}" stroke="${colour(group % 6)}"`;
    if (group < 6) return html`<circle cx="${x}" cy="${y}" r="4"${paint}>${tip}</circle>`;
    return html`<path d="M${x} ${y}m0 -5l4.5 8h-9z"${paint}>${tip}</path>`;
  };
  const places = points.map(({ time, y }) => place(time.median, y)), groups = points.map(({ row }) => parameters.indexOf(row.parameter));
  const taken = places.map(([x, y]) => [x - 5, y - 5, x + 5, y + 5]);
  const labels = points.map(({ row }, i) => {
    if (!isLabelled(i)) return "";
    const short = row.setting.split(" (")[0], name = isNaN(Number(short)) ? short : `${row.parameter} ${short}`;
    const [x, y] = places[i], wide = 7 * name.length, [left, right] = [x - 7 - wide, x + 7];
    // To the lower left of a mark of the Pareto front there are no others.
    const corners = [0, 13].flatMap((more) => {
      const [above, below] = [y - 15 - more, y + 2 + more];
      return [[left, below], [right, above], [left, above], [right, below], [right, y - 6]];
    });
    const isInside = (box) => box[0] >= edges[0] && box[1] >= edges[1] && box[2] <= edges[2] && box[3] <= edges[3];
    const overlaps = (a, b) => a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
    const boxes = corners.map(([x, y]) => [x, y, x + wide, y + 13]);
    const free = boxes.find((box) => isInside(box) && !taken.some((other) => overlaps(box, other)));
    if (!free) return "";
    taken.push(free);
    return at(free[0], free[3] - 2, name, html` font-size="12"`);
  });
  const path = joined.map((i, n) => (n ? `H${places[i][0]}V${places[i][1]}` : `M${places[i]}`)).join("");
  const columnOf = (time) => {
    const [column] = place(time, y[0]);
    return html`<path class="grid" d="M${column} ${edges[1]}V${bottom}"/>${at(column, bottom + 16, label(time), MIDDLE)}`;
  };
  const lineOf = (error) => {
    const [, line] = place(x[0], error);
    return html`<path class="grid" d="M${edges[0]} ${line}H${edges[2]}"/>${at(edges[0] - 6, line + 4, label(error), END)}`;
  };
  const noise = () => {
    const [, line] = place(x[0], floor);
    return html`<path class="ink" stroke-dasharray="4 4" d="M${edges[0]} ${line}H${edges[2]}"/>
${at(edges[0] + 6, line - 5, "noise of the limit", html` class="faint"`)}`;
  };
  const drawn = ({ row, time, y }, i) => {
    const tip = html`<title>${nameOf(row)}: ${ms(time)} ms, error ${number(y)}</title>`;
    const [left, right] = [time.lower, time.upper].map((time) => place(time, y)[0]);
    return html`<path stroke="${colour(groups[i] % 6)}" d="M${left} ${places[i][1]}H${right}"/>${mark(places[i], groups[i], isLabelled(i), tip)}`;
  };
  const named = (name, i) => {
    const [x, y] = [10 + 150 * (i % columns), 410 + 18 * Math.floor(i / columns)];
    return html`${mark([x, y], parameters.indexOf(name), true)}${at(x + 10, y + 4, name)}`;
  };
  const errors = [...ticks([Math.max(low, 1.2 * zero), y[1]], 9), ...(hasZero ? [0] : [])];
  const content = html`${ticks(x, (edges[2] - edges[0]) / 48).map(columnOf)}${errors.map(lineOf)}
<path class="ink" d="M${edges[0]} ${edges[1]}V${bottom}H${edges[2]}"/>
${at((edges[0] + edges[2]) / 2, bottom + 36, "time of the picture, milliseconds", MIDDLE)}${at(0, 12, title)}
${floor > 0 ? noise() : ""}<path class="ink" d="${path}"/>${points.map(drawn)}${labels}${own.map(named)}`;
  return [404 + 18 * Math.ceil(own.length / columns), content];
};

const compared = study.compared.map((id) => rows[id]);
const point = (row, y) => ({ row, time: row.trace_ms, y });
const front = (ids, among) => ids.map((id) => among.findIndex((point) => point.row.id === id)).filter((i) => i >= 0);
const show = (id, points, options) => (points.length ? plotted(`#${id}`, scatter(points, options)) : $(`#${id}`).parentElement.remove());
{
  const points = compared.map((row) => point(row, 255 * row.limit.rmse)), joined = front(study.front, points);
  show("limit", points, { joined, floor: 255 * (study.floors[0]?.rmse ?? 0), title: "RMS error, steps of 255", isLabelled: (i) => joined.includes(i) });
  const twins = rows.filter((row) => row.reference === "twin" && row.twin && !row.has_effect_off).map((row) => point(row, 255 * row.twin.rmse));
  show("twin", twins, { title: "RMS error, steps of 255", isLabelled: (i) => twins[i].y > 0 });
  const ofPaths = tracesPaths ? [...PATHS, "samples", "together"] : [];
  const paths = compared.filter((row) => ofPaths.includes(row.parameter)).map((row) => point(row, row.limit.rel_mse));
  const best = front(study.front_of_paths, paths);
  show("paths", paths, { joined: best, title: "relMSE", isLabelled: (i) => best.includes(i) });
}

if (shown.length) {
  const choice = $("#choice"), slider = $(".slider"), own = $(".slider .own"), covered = $(".slider .reference");
  const split = (percent) => {
    const held = Math.min(100, Math.max(0, percent));
    covered.style.clipPath = `inset(0 ${100 - held}% 0 0)`;
    slider.setAttribute("aria-valuenow", Math.round(held));
  };
  const move = ({ clientX }) => split((100 * (clientX - slider.getBoundingClientRect().left)) / slider.clientWidth);
  slider.addEventListener("pointerdown", (event) => { slider.setPointerCapture(event.pointerId); move(event); });
  slider.addEventListener("pointermove", (event) => { if (event.buttons) move(event); });
  slider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -5, ArrowRight: 5 }[event.key];
    if (step) { split(Number(slider.getAttribute("aria-valuenow")) + step); event.preventDefault(); }
  });
  const look = (id) => {
    const files = pictures.rows[id], row = rows[id], isSame = files.heat == null;
    choice.value = id;
    document.querySelectorAll("tr.chosen").forEach((line) => line.classList.remove("chosen"));
    $(`tr[data-row="${id}"]`).classList.add("chosen");
    own.src = pictures.files[files.own];
    covered.src = pictures.files[files.reference];
    $(".slider .a").textContent = reference(row);
    $(".slider .b").textContent = nameOf(row);
    $("#command").innerHTML = text(command(study.commands[id]));
    $("#nothing").hidden = !isSame;
    $("#heat").hidden = $("#worst").hidden = isSame;
    if (isSame) return;
    $("#heat img").src = pictures.files[files.heat];
    $(".crops").innerHTML = html`${["reference", nameOf(row), "difference"].map((title) => html`<div>${title}</div>`)}${files.worst.map((place) =>
      [files.reference, files.own, files.heat].map((file) => crop(file, place, ENLARGED, "enlarged")))}`;
  };
  choice.addEventListener("change", () => look(Number(choice.value)));
  for (const { id } of shown) $(`tr[data-row="${id}"]`).addEventListener("click", () => { look(id); $("#look").scrollIntoView({ behavior: "smooth" }); });
  split(50);
  look((shown.find((row) => row.base) ?? shown[0]).id);
}
