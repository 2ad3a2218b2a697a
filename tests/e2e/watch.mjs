// Drives the page of `sunfleck watch` in headless Chromium, as a person would: load, edit, break, mend, drag, compare,
// inspect, save. Needs node and playwright-core (NODE_PATH or a node_modules above) and a chromium.
//   node tests/e2e/watch.mjs [SUNFLECK] [SCREENSHOT_FOLDER]

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { get } from "node:http";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { chromium } = createRequire(import.meta.url)("playwright-core");
const sunfleck = process.argv[2] ?? "target/release/sunfleck";
const screenshots = process.argv[3];
const folder = mkdtempSync(join(tmpdir(), "sunfleck-e2e-"));
const shaders = join(folder, "shaders");
const leaf = join(shaders, "include", "bsdf_lambertian.glsl");
const figures = {};

assert.equal(spawnSync(sunfleck, ["shaders", "export", shaders]).status, 0, "shaders export");
const original = readFileSync(leaf, "utf8");
const child = spawn(sunfleck, ["watch", "cornell", "--shaders", shaders, "--port", "0", "--spp", "64", "--resolution", process.env.SUNFLECK_E2E_RESOLUTION ?? "256x256"], { stdio: ["ignore", "ignore", "pipe"] });
let log = "";
const address = await new Promise((resolve, reject) => {
  child.stderr.on("data", (data) => {
    log += data;
    const found = log.match(/page: (\S+)\n/);
    if (found) resolve(found[1]);
  });
  child.on("exit", () => reject(new Error(`sunfleck has ended:\n${log}`)));
});

const status = (path, headers) => new Promise((resolve, reject) => {
  get(address + path, { headers }, (answer) => resolve(answer.resume().statusCode)).on("error", reject);
});

// A factor that no kernel was ever built with: drivers keep what they have compiled.
const fresh = () => 0.8 + 0.2 * Math.random();

const step = async (name, work) => {
  const start = performance.now();
  await work();
  figures[name] = Math.round(performance.now() - start);
  console.log(`ok  ${name} (${figures[name]} ms)`);
};

// Ticks (1/100 s) of processor time of a process and its children, on Linux.
const ticks = (pid) => {
  const [, , ...stat] = readFileSync(`/proc/${pid}/stat`, "utf8").replace(/^\d+ \(.*\)/, "x x").split(" ");
  const children = readFileSync(`/proc/${pid}/task/${pid}/children`, "utf8").trim().split(" ").filter(Boolean);
  return Number(stat[11]) + Number(stat[12]) + children.reduce((sum, child) => sum + ticks(child), 0);
};

let browser;
try {
  browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 }, acceptDownloads: true });
  const errors = [];
  const hosts = new Set();
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  page.on("request", (request) => hosts.add(new URL(request.url()).host));
  const shot = async (name) => screenshots && page.screenshot({ path: join(screenshots, `${name}.png`) });
  const mean = () => page.evaluate(() => {
    const canvas = document.getElementById("picture");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    let sum = [0, 0, 0];
    for (let i = 0; i < data.length; i += 4) for (let c = 0; c < 3; c++) sum[c] += data[i + c];
    return sum.map((s) => (4 * s) / data.length);
  });
  // The last image may still be decoded when the server says that it is done.
  const finished = () => page.waitForFunction(() => document.getElementById("stage").textContent === "finished" && document.body.dataset.spp === "64", null, { timeout: 120000 });
  const edit = (n) => page.waitForFunction((n) => Number(document.body.dataset.edit) >= n, n, { timeout: 60000 });
  const frames = () => page.evaluate(() => Number(document.body.dataset.frames ?? 0));

  await step("load and see pixels", async () => {
    await page.goto(address);
    await page.waitForFunction(() => Number(document.body.dataset.frames) > 0, null, { timeout: 60000 });
    const [r, g, b] = await mean();
    assert(r > 20 && g > 20 && b > 20, `${[r, g, b]}`);
  });
  await step("finish", finished);
  await shot("large");
  const before = await mean();
  if (process.platform === "linux") {
    await step("a finished picture uses no processor time", async () => {
      await page.waitForTimeout(300);
      const start = ticks(child.pid);
      await page.waitForTimeout(1000);
      const used = ticks(child.pid) - start;
      assert(used <= 1, `${used} ticks of 10 ms in a second`);
    });
  }

  await step("the page offers what the program knows", async () => {
    for (const flag of ["integrator", "light-sampling", "mis", "light-choice", "env-sampling", "sampler", "tonemap"]) {
      const offered = await page.$$eval(`#${flag} option`, (options) => options.map((option) => option.text));
      const refusal = spawnSync(sunfleck, ["render", `--${flag}=nonsense`]).stderr.toString();
      const known = refusal.match(/possible values: ([^\]]*)\]/);
      // The page's `auto` is the flag left out.
      assert.deepEqual(offered.filter((name) => name !== "auto"), known?.[1].split(/,\s+/), `${flag}: ${refusal}`);
    }
    assert.match(await page.textContent("#command"), /^sunfleck render cornell --resolution=\d+x\d+ --spp=64 --shaders=\S+$/);
  });
  await step("freeze A", async () => {
    await page.keyboard.press("f");
    await page.waitForFunction(() => !document.getElementById("compare").disabled);
  });
  await step("edit a leaf: first new image", async () => {
    writeFileSync(leaf, original.replaceAll("p.color", "p.color.gbr"));
    await edit(1);
  });
  const edited = await mean();
  assert(Math.abs(edited[0] / edited[2] - before[0] / before[2]) > 0.1, `the picture is another: ${before} ${edited}`);
  await step("break: error on the page", async () => {
    writeFileSync(leaf, `${original}\nfloat broken() { return undeclared_name; }\n`);
    await page.waitForFunction(() => document.getElementById("problems").textContent.includes("undeclared_name"));
  });
  const problem = await page.textContent("#problems");
  const line = original.split("\n").length + 1;
  assert(problem.includes(`include/bsdf_lambertian.glsl:${line}:`), problem);
  assert(problem.includes("float broken()"), problem);
  await shot("error");
  await step("mend", async () => {
    writeFileSync(leaf, original);
    await page.waitForFunction(() => document.getElementById("problems").hidden, null, { timeout: 60000 });
    await edit(2);
    const mended = await mean();
    assert(Math.abs(mended[0] / mended[2] - before[0] / before[2]) < 0.1, `as before: ${before} ${mended}`);
  });
  // SUNFLECK_E2E_EDITS=20 measures as many edits: medians from the save to the error, to the first new image, and of the
  // latter what is not the driver's build.
  const times = { error: [], image: [], "image, of which not the driver's build": [] };
  for (let i = 0; i < Number(process.env.SUNFLECK_E2E_EDITS ?? 0); i++) {
    let start = performance.now();
    writeFileSync(leaf, `${original}\nfloat broken() { return undeclared_${i}; }\n`);
    await page.waitForFunction((i) => document.getElementById("problems").textContent.includes(`undeclared_${i}`), i);
    times.error.push(performance.now() - start);
    const before = await page.evaluate(() => document.body.dataset.edit);
    start = performance.now();
    writeFileSync(leaf, original.replaceAll("p.color", `(p.color * ${fresh()})`));
    await page.waitForFunction((before) => document.body.dataset.edit !== before, before, { timeout: 60000 });
    times.image.push(performance.now() - start);
    const build = await page.textContent("#edits tr:nth-child(2) td:nth-child(2)");
    times["image, of which not the driver's build"].push(times.image.at(-1) - parseInt(build));
  }
  for (const [name, list] of Object.entries(times)) {
    if (list.length > 0) figures[`save to ${name}, median`] = Math.round(list.sort((a, b) => a - b)[list.length >> 1]);
  }
  writeFileSync(leaf, original);

  await step("switch the integrator", async () => {
    await page.selectOption("#integrator", "emission");
    await page.waitForFunction(() => document.getElementById("command").textContent.includes("--integrator=emission"));
    await page.waitForTimeout(1500);
    await finished();
    const dark = await mean();
    assert(dark[0] < before[0] / 2, `${before} ${dark}`);
    await page.selectOption("#integrator", "path");
    await page.waitForTimeout(1500);
  });
  await finished();
  await step("drag the camera", async () => {
    const count = await frames();
    const start = performance.now();
    const box = await page.locator("#picture").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    for (let i = 0; i < 60; i++) {
      await page.mouse.move(box.x + box.width / 2 + 2 * i, box.y + box.height / 2 + i / 2);
      await page.waitForTimeout(25);
    }
    assert.match(await page.textContent("#command"), / --look-at=[-\d.e,]+:[-\d.e,]+:[-\d.e,]+/);
    figures["images per second in a drag"] = ((await frames()) - count) / ((performance.now() - start) / 1000);
    await page.mouse.up();
    await page.waitForTimeout(500);
  });
  await finished();
  await step("wipe and difference", async () => {
    await page.keyboard.press("w");
    await shot("wipe");
    assert.equal(await page.inputValue("#compare"), "wipe");
    await page.keyboard.press("d");
    const difference = await mean();
    assert(difference[0] > 1 && difference[0] < 200, `${difference}`);
    await page.keyboard.press("h");
    await shot("heat");
    await page.keyboard.press("b");
  });
  await step("fingers turn, pinch and move the camera", async () => {
    const box = await page.locator("#picture").boundingBox();
    const at = (x, y) => ({ x: box.x + x * box.width, y: box.y + y * box.height });
    const touch = await page.context().newCDPSession(page);
    const fingers = async (type, ...touchPoints) => {
      await touch.send("Input.dispatchTouchEvent", { type, touchPoints: touchPoints.map((point, id) => ({ ...point, id })) });
      await page.waitForTimeout(50);
    };
    const pose = async () => {
      const [eye, target] = (await page.textContent("#command")).match(/--look-at=(\S+)/)[1].split(":").map((p) => p.split(",").map(Number));
      return { eye, target, distance: Math.hypot(...eye.map((x, i) => x - target[i])) };
    };
    const start = await pose();
    await fingers("touchStart", at(0.4, 0.5));
    await fingers("touchMove", at(0.5, 0.5));
    await fingers("touchEnd");
    const turned = await pose();
    assert.deepEqual(turned.target, start.target, "one finger turns about the target");
    assert(Math.abs(turned.distance / start.distance - 1) < 1e-9 && turned.eye[0] !== start.eye[0], JSON.stringify([start, turned]));
    await fingers("touchStart", at(0.4, 0.5), at(0.6, 0.5));
    await fingers("touchMove", at(0.3, 0.5), at(0.7, 0.5));
    await fingers("touchEnd");
    const nearer = await pose();
    assert(Math.abs(nearer.distance / turned.distance - 0.5) < 0.02, `twice as far apart, half the distance: ${turned.distance} ${nearer.distance}`);
    assert(Math.hypot(...nearer.target.map((x, i) => x - turned.target[i])) < 1e-6, "what is in the middle stays there");
    await fingers("touchStart", at(0.4, 0.5), at(0.6, 0.5));
    await fingers("touchMove", at(0.4, 0.6), at(0.6, 0.6));
    await fingers("touchEnd");
    const moved = await pose();
    assert(Math.abs(moved.distance / nearer.distance - 1) < 0.05 && moved.target[1] > nearer.target[1], "the picture goes with both fingers");
    assert(await page.evaluate(() => document.getElementById("mark").hidden), "a finger that moved pins nothing");
    await page.waitForTimeout(500);
  });
  await finished();
  await step("the page goes on while a kernel is built", async () => {
    await page.evaluate(() => {
      window.arrivals = [];
      new MutationObserver(() => window.arrivals.push([performance.now(), Number(document.body.dataset.edit)]))
        .observe(document.body, { attributes: true, attributeFilter: ["data-frames"] });
    });
    const box = await page.locator("#picture").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    const old = await page.evaluate(() => Number(document.body.dataset.edit));
    let saved;
    for (let i = 0; i < 400; i++) {
      await page.mouse.move(box.x + box.width / 2 + 100 * Math.sin(i / 20), box.y + box.height / 2);
      await page.waitForTimeout(20);
      if (i === 20) {
        saved = await page.evaluate(() => performance.now());
        writeFileSync(leaf, original.replaceAll("p.color", `(p.color * ${fresh()})`));
      }
      if ((await page.evaluate(() => Number(document.body.dataset.edit))) !== old) break;
    }
    await page.mouse.up();
    const arrivals = (await page.evaluate(() => window.arrivals)).filter(([at]) => at > saved);
    const meanwhile = arrivals.filter(([, edit]) => edit === old);
    const times = [saved, ...meanwhile.map(([at]) => at), arrivals.find(([, edit]) => edit !== old)[0]];
    figures["images of the old kernel while the new one is built"] = meanwhile.length;
    figures["longest stall of a drag while it is built"] = Math.round(Math.max(...times.slice(1).map((at, i) => at - times[i])));
    assert(meanwhile.length >= 3, `${times}`);
    await page.click("#reset");
    writeFileSync(leaf, original);
    await edit(old + 2);
  });
  await finished();
  await step("inspect a pixel", async () => {
    await page.locator("#picture").click({ position: { x: 200, y: 200 } });
    await page.waitForFunction(() => document.getElementById("pixel-samples").textContent === "64");
    const radiance = (await page.textContent("#pixel-radiance")).trim().split(/\s+/).map(Number);
    assert(radiance.length === 3 && radiance.every((c) => c >= 0), `${radiance}`);
    assert.match(await page.textContent("#pixel-material"), /\(lambertian/);
    assert.match(await page.textContent("#pixel-triangle"), /^\d+ of primitive \d+$/);
    assert.match(await page.textContent("#pixel-distance"), / m$/);
  });
  await step("DEBUG_PIXEL is the picture, DEBUG_PRINT is listed with its line", async () => {
    const light = await mean();
    const call = "DEBUG_PIXEL(vec3(0.0, 0.5, 1.0)); DEBUG_PRINT(p.color);";
    const scatter = "vec3 wi = sample_cosine_hemisphere(u.yz);";
    assert(original.includes(scatter));
    const now = await page.evaluate(() => Number(document.body.dataset.edit));
    writeFileSync(leaf, original.replace(scatter, `${call}\n    ${scatter}`));
    await edit(now + 1);
    const [r, g, b] = await mean();
    assert(r < 5 && g > 100 && b > 200, `${[r, g, b]}`);
    await page.waitForFunction(() => document.getElementById("prints-list").textContent.includes("p.color = ("));
    assert.match(await page.textContent("#prints-list"), /bsdf_lambertian.glsl:\d+/);
    await shot("debug");
    await page.keyboard.press("v");
    await page.waitForTimeout(1500);
    await finished();
    const back = await mean();
    assert(Math.abs(back[0] - light[0]) < 5, `the calls stand there, the light is shown: ${light} ${back}`);
    await page.keyboard.press("v");
    writeFileSync(leaf, original);
    await page.waitForFunction(() => document.getElementById("debug-row").hidden && document.getElementById("prints").hidden);
    await edit(now + 2);
    await finished();
  });
  await step("other estimators", async () => {
    const light = await mean();
    const starts = () => page.evaluate(() => document.body.dataset.start);
    for (const [id, value, isDefault] of [["light-sampling", "bsdf"], ["light-sampling", "mis", true], ["sampler", "independent"], ["sampler", "sobol", true], ["light-choice", "uniform"], ["light-choice", "bvh", true], ["env-sampling", "importance"], ["env-sampling", "auto", true]]) {
      const before = await starts();
      await page.selectOption(`#${id}`, value);
      await page.waitForFunction((before) => document.body.dataset.start !== before, before, { timeout: 60000 });
      assert.equal((await page.textContent("#command")).includes(`--${id}=${value}`), !isDefault);
    }
    const before = await starts();
    await page.fill("#max-bounces", "1");
    await page.keyboard.press("Tab");
    await page.waitForFunction((before) => document.body.dataset.start !== before, before, { timeout: 60000 });
    const direct = await mean();
    assert(direct[0] < light[0] - 5, `${light} ${direct}`);
    await page.fill("#max-bounces", "");
    await page.keyboard.press("Tab");
    await page.waitForTimeout(1000);
    await finished();
  });
  await step("AOVs are the picture, and what is counted is shown", async () => {
    const light = await mean();
    const shown = (name) => page.waitForFunction((name) => document.body.dataset.shown === name, name, { timeout: 60000 });
    await page.keyboard.press("2");
    await shown("normal");
    const [, , blue] = await mean();
    assert(blue > 100, `the back wall's normal is +Z: ${await mean()}`);
    await finished();
    const start = await page.evaluate(() => document.body.dataset.start);
    await page.keyboard.press("3");
    await shown("depth");
    assert.equal(await page.evaluate(() => document.body.dataset.start), start, "nothing is built or rendered for another AOV");
    assert.match(await page.textContent("#scale"), /white [\d.]+ m/);
    assert.match(await page.textContent("#command"), / --aov=depth/);
    await page.waitForFunction(() => document.getElementById("pixel-aovs").textContent.includes("normal"));
    await shot("depth");
    await page.keyboard.press("c");
    await page.waitForFunction(() => !document.getElementById("counts").hidden, null, { timeout: 60000 });
    assert.match(await page.textContent("#counts-rays"), /camera.*shadow.*all/s);
    assert.match(await page.textContent("#counts-lanes"), /\d %/);
    await finished();
    await page.evaluate(() => document.getElementById("counts").scrollIntoView({ block: "center" }));
    await shot("counts");
    await page.keyboard.press("c");
    await page.keyboard.press("0");
    await shown("light");
    await page.waitForFunction((start) => document.body.dataset.start > start && document.getElementById("counts").hidden, start, { timeout: 60000 });
    await finished();
    const back = await mean();
    assert(back.every((c, i) => Math.abs(c - light[i]) < 0.01), `the same light again: ${light} ${back}`);
  });
  await step("save", async () => {
    for (const [button, magic] of [["#png", "89504e47"], ["#exr", "762f3101"]]) {
      const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
      const file = join(folder, download.suggestedFilename());
      await download.saveAs(file);
      assert.equal(readFileSync(file).subarray(0, 4).toString("hex"), magic);
    }
  });
  await step("a small and a dark window", async () => {
    await page.setViewportSize({ width: 390, height: 844 });
    await page.emulateMedia({ colorScheme: "dark" });
    await page.waitForTimeout(300);
    await shot("small-dark");
    await page.evaluate(() => document.querySelector("aside").scrollIntoView());
    await shot("small-dark-controls");
    await page.setViewportSize({ width: 1600, height: 1000 });
    await page.waitForTimeout(300);
    await shot("large-dark");
    await page.setViewportSize({ width: 1920, height: 1080 });
    await page.waitForTimeout(300);
    await shot("wide-dark");
    await page.emulateMedia({ colorScheme: "light" });
    await page.waitForTimeout(300);
    await shot("wide");
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth > innerWidth);
    assert(!overflow, "the page scrolls sideways");
  });
  await step("strangers are refused", async () => {
    assert.equal(await status("/", { Host: "evil.example" }), 403);
    assert.equal(await status("/socket", { Origin: "http://evil.example" }), 403);
    assert.equal(await status("/../Cargo.toml", {}), 404);
  });
  assert.deepEqual(errors, [], "errors in the console");
  assert.deepEqual([...hosts].filter((host) => host && host !== new URL(address).host), [], "requests to other hosts");
  console.log(JSON.stringify(figures));
} catch (error) {
  console.error(log);
  throw error;
} finally {
  await browser?.close();
  child.kill();
  rmSync(folder, { recursive: true, force: true });
}
