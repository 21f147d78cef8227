"use strict";
(() => {
  const data = JSON.parse(document.getElementById("pictures").textContent);
  const rows = JSON.parse(document.getElementById("rows").textContent);
  const $ = (id) => document.getElementById(id);

  // Draws a square of pixels around a place, each as large as there is room for.
  const crop = (file, [x, y], side, canvas = document.createElement("canvas")) => {
    canvas.width = canvas.height = side;
    const image = new Image();
    image.onload = () => {
      const hold = (at, size) => Math.max(0, Math.min(at - (side >> 1), size - side));
      canvas.getContext("2d").drawImage(image, hold(x, image.width), hold(y, image.height), side, side, 0, 0, side, side);
    };
    image.src = file;
    return canvas;
  };
  document.querySelectorAll("canvas[data-file]").forEach((canvas) => {
    const { file, x, y } = canvas.dataset;
    crop(data.files[file], [Number(x), Number(y)], 64, canvas);
  });
  document.querySelectorAll("img[data-file]").forEach((image) => { image.src = data.files[image.dataset.file]; });

  const choice = $("choice");
  if (!choice) return;
  const slider = $("slider"), top = slider.querySelector(".top");
  const [own, reference] = [slider.querySelector("img.own"), top.querySelector("img")];
  let split = 0.5;
  const place = () => {
    top.style.width = `${split * 100}%`;
    reference.style.width = `${slider.clientWidth}px`;
    slider.setAttribute("aria-valuenow", String(Math.round(split * 100)));
  };
  const move = (event) => {
    const box = slider.getBoundingClientRect();
    split = Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
    place();
  };
  slider.addEventListener("pointerdown", (event) => { slider.setPointerCapture(event.pointerId); move(event); });
  slider.addEventListener("pointermove", (event) => { if (event.buttons) move(event); });
  slider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.05, ArrowRight: 0.05 }[event.key];
    if (step) { split = Math.min(1, Math.max(0, split + step)); place(); event.preventDefault(); }
  });
  addEventListener("resize", place);


  const show = (id) => {
    const picture = data.rows[id], row = rows[id];
    choice.value = id;
    document.querySelectorAll("tr.chosen").forEach((tr) => tr.classList.remove("chosen"));
    document.querySelectorAll(`tr[data-row="${id}"]`).forEach((tr) => tr.classList.add("chosen"));
    own.src = data.files[picture.own];
    reference.src = data.files[picture.reference];
    $("what").textContent = row.what;
    $("name").textContent = row.name;
    const heat = $("heat"), crops = $("crops");
    heat.hidden = picture.heat === null;
    $("nothing").hidden = !heat.hidden;
    crops.replaceChildren();
    if (picture.heat !== null) {
      heat.querySelector("img").src = data.files[picture.heat];
      const head = (text) => {
        const div = document.createElement("div");
        div.className = "head";
        div.textContent = text;
        return div;
      };
      ["reference", row.name, "difference"].forEach((text) => crops.append(head(text)));
      for (const at of picture.worst) {
        for (const file of [picture.reference, picture.own, picture.heat]) {
          const canvas = crop(data.files[file], at, 25);
          canvas.title = `around column ${at[0]}, row ${at[1]}`;
          crops.append(canvas);
        }
      }
    }
    $("worst").hidden = picture.heat === null;
    place();
  };
  choice.addEventListener("change", () => show(Number(choice.value)));
  document.querySelectorAll("tr[data-row]").forEach((tr) => {
    const id = Number(tr.dataset.row);
    if (data.rows[id]) tr.addEventListener("click", () => { show(id); $("look").scrollIntoView({ behavior: "smooth" }); });
  });
  own.addEventListener("load", place);
  show(Number(choice.value));
})();
