(() => {
  "use strict";
  const AROUND = 90e3;
  const holder = document.getElementById("series");
  const item = JSON.parse(document.getElementById("series-item").textContent);

  // The drawing follows the page's style sheet, by day and by night.
  function paint(models) {
    const sheet = getComputedStyle(document.documentElement);
    const colour = name => sheet.getPropertyValue(`--${name}`).trim();
    const [ink, faint] = [colour("ink"), colour("faint")];
    for (const model of models) {
      const tag = model.tags?.[0];
      if (tag && model.glyph) {
        const own = colour(tag);
        for (const part of ["line_color", "fill_color", "hatch_color"])
          if (part in model.glyph) model.glyph[part] = {value: own};
      } else if (tag) {
        model.line_color = colour(tag);
      } else if (model.type.endsWith("Axis")) {
        model.setv({axis_label_text_color: ink, major_label_text_color: ink, axis_line_color: ink,
          major_tick_line_color: ink, minor_tick_line_color: faint});
      } else if (model.type === "Grid") {
        model.grid_line_color = faint;
      }
    }
  }

  function control(doc) {
    const range = doc.get_model_by_name("time");
    const whole = [range.start, range.end];
    const choice = document.getElementById("series-window");
    const show = (start, end) => range.setv({start, end});
    const chosen = () => {
      const middle = Date.parse(choice.value);
      choice.value ? show(middle - AROUND, middle + AROUND) : show(...whole);
    };
    const step = by => () => {
      const count = choice.options.length;
      choice.selectedIndex = (choice.selectedIndex + by + count) % count;
      chosen();
    };
    const scale = by => () => {
      const middle = (range.start + range.end) / 2, half = by * (range.end - range.start) / 2;
      show(Math.max(whole[0], middle - half), Math.min(whole[1], middle + half));
    };
    choice.addEventListener("change", chosen);
    for (const [name, action] of [["before", step(-1)], ["next", step(1)], ["closer", scale(0.5)], ["wider", scale(2)]])
      document.getElementById(`series-${name}`).addEventListener("click", action);
    holder.querySelectorAll(".layers input").forEach(box => box.addEventListener("change", () => {
      for (const model of doc._all_models.values())
        if (model.glyph && model.tags.includes(box.value)) model.visible = box.checked;
    }));
  }

  holder.hidden = false;
  Bokeh.embed.embed_item(item, "series-plot").then(views => {
    const doc = [...views][0].model.document;
    const repaint = () => paint([...doc._all_models.values()]);
    repaint();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
    control(doc);
    holder.closest("figure").classList.add("live");
    window.seatrialSeries = doc;
  }, () => { holder.hidden = true; });
})();
