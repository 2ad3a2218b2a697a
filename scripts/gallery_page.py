"""docs/gallery/README.md, made from the list of models (`gallery.py`)."""

from pathlib import Path

HEAD = """# Gallery: other people's models

What Sunfleck makes of files that it has not seen before: one line a model, with what its author says it should show (its README, its
labels, or what its file says) and what our image shows. Written by `make gallery MODELS=FOLDER` from [models.json](models.json);
the models themselves are not in this repository, their origins are in the [list below](#origins-and-licences).

{count} models: {right} right; {partly} in part, for want of a feature that is not built yet (the renderer says so); {design} differ by design; {wrong} wrong.

Unless the line says otherwise: {samples} samples per pixel, the camera that Sunfleck adds to a scene without one, light from
*Brown Photostudio 02* (Poly Haven, CC0), tone curve `clip`. *Turned* and *facing* mean that the model stands on a turntable before that
camera; many images have a narrower field of view.
"""

VERDICTS = {"right": "right", "partly": "in part", "design": "by design", "wrong": "**wrong**"}


def row(model: dict) -> str:
    image = "refused" if model.get("refused") else f"![{model['name']}]({model['name'].replace(' ', '%20')}.jpg)"
    how = [f"turned {model['turn']}°"] if "turn" in model else ["facing the camera"] if "facing" in model else []
    how += ["its own light"] if "environment" in model else []
    how += [f"{model['spp']} samples"] if "spp" in model else []
    how += [f"`{' '.join(model['flags'])}`"] if model.get("flags") else []
    name = f"**{model['name']}**" + (f" ({', '.join(how)})" if how else "")
    return f"| {image} | {name}<br>*Should show:* {model['should']}<br>*Shows:* {model['shows']} | {VERDICTS[model['verdict']]} |"


def origin_row(model: dict, sources: dict) -> str:
    folder, _, rest = model["file"].partition("/")
    source = sources[folder]
    return f"| {model['name']} | [{source['name']}]({source['url']}) `{rest}` | {model.get('credit', source['licence'])} |"


def write_page(table: dict, folder: Path) -> None:
    models = table["models"]
    counts = {verdict: sum(model["verdict"] == verdict for model in models) for verdict in VERDICTS}
    lines = [HEAD.format(count=len(models), samples=table["spp"], **counts)]
    for group in dict.fromkeys(model["group"] for model in models):
        lines += [f"## {group}", "", "| image | model | verdict |", "|---|---|---|"]
        lines += [row(model) for model in models if model["group"] == group] + [""]
    lines += ["## Origins and licences", "", "The images are ours; the models are their authors'.", "",
              "| model | file | author, licence |", "|---|---|---|"]
    lines += [origin_row(model, table["sources"]) for model in models]
    (folder / "README.md").write_text("\n".join(lines) + "\n")
