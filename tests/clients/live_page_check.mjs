// Opens the live page in Chromium, whose microphone is a recording, and prints what happens.
// node live_page_check.mjs NODE_MODULES CHROMIUM URL SPEECH.wav talk PICTURE.png: as JSON
// node live_page_check.mjs NODE_MODULES CHROMIUM URL SPEECH.wav wait: what the page says, line by line, until stdin ends
import { createRequire } from "node:module";
import { writeFileSync } from "node:fs";

const [modules, executablePath, url, speech, what, picture] = process.argv.slice(2);
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const quiet = ["--no-sandbox", "--mute-audio", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"];
const drawn = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
const microphone = ["--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream", `--use-file-for-fake-audio-capture=${speech}%noloop`];
const browser = await chromium.launch({ executablePath, args: [...quiet, ...drawn, ...microphone] });
// Small while it listens: drawing without a graphics card takes the processor from the server.
const context = await browser.newContext({ viewport: { width: 400, height: 400 } });
const page = await context.newPage();
const requests = [], errors = [];
page.on("request", (request) => requests.push(request.url()));
page.on("websocket", (socket) => requests.push(socket.url()));
page.on("pageerror", (error) => errors.push(String(error)));
page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
await page.goto(url);
await page.waitForFunction(() => window.facecode);
const said = () => page.textContent("#status");
const until = (text) => page.waitForFunction((text) => document.getElementById("status").textContent.includes(text), text, { timeout: 60_000 });

async function talk() {
  const found = { before: await said(), meter_before: await page.isVisible("#meter") };
  await page.evaluate(() => { Playout.prototype.forgetBefore = () => {}; });
  await page.click("#speak");
  await until("Listening");
  found.pressed = await page.getAttribute("#speak", "aria-pressed");
  await page.waitForFunction(() => facecode.weights?.some((weight) => weight > 0.2) && facecode.head.positions.some((value, i) => value !== facecode.head.rest[i]), undefined, { timeout: 60_000 });
  await page.waitForFunction(() => facecode.playout.end > 9, undefined, { timeout: 200_000 });
  Object.assign(found, await page.evaluate(() => ({
    frames: facecode.playout.frames.map(({ index, time, weights }) => [index, time, ...weights]),
    skipped: facecode.skipped,
    shown: facecode.lag.shown,
    delays: facecode.lag.delays,
  })));
  found.latency = await page.textContent("#latency");
  found.details = await page.textContent("#details");
  await page.setViewportSize({ width: 960, height: 720 });
  await page.waitForTimeout(400);
  await page.screenshot({ path: picture });
  await page.setViewportSize({ width: 400, height: 400 });
  await page.click("#speak");
  found.after = await said();
  await page.waitForTimeout(200);
  found.rests = await page.evaluate(() => facecode.head.positions.every((value, i) => value === facecode.head.rest[i]));
  const rest = () => page.evaluate(() => Array.from(facecode.head.rest.subarray(0, 300)).join());
  const first = await rest();
  await page.selectOption("#identity", { index: 3 });
  await page.waitForFunction((first) => Array.from(facecode.head.rest.subarray(0, 300)).join() !== first, first);
  await page.selectOption("#style", { index: 1 });
  await page.setInputFiles("#file", speech);
  await page.waitForFunction(() => facecode.source?.moment > 1, undefined, { timeout: 60_000 });
  await until("Press Speak");
  found.file_played = await page.evaluate(() => facecode.playout.frames.length);
  await page.click("#sample");
  await page.waitForFunction(() => facecode.source?.moment > 0.5, undefined, { timeout: 60_000 });
  await page.click("#speak");
  writeFileSync(`${picture}.txt`, "no sound");
  await page.setInputFiles("#file", `${picture}.txt`);
  await until("cannot read");
  await page.setViewportSize({ width: 390, height: 700 });
  found.wider_than_the_phone = await page.evaluate(() => document.documentElement.scrollWidth > window.innerWidth);
  await page.screenshot({ path: picture.replace(".png", "-phone.png") });
  return found;
}

async function wait() {
  const tell = (text) => process.stdout.write(`${text}\n`);
  await page.exposeFunction("tell", tell);
  await page.evaluate(() => {
    new MutationObserver(() => tell(document.getElementById("status").textContent)).observe(document.getElementById("status"), { childList: true });
    const add = Playout.prototype.add;
    Playout.prototype.add = function (frames) {
      if (!this.frames.length) tell("frames");
      add.call(this, frames);
    };
  });
  await page.click("#speak");
  await new Promise((done) => process.stdin.on("end", done).resume());
}

if (what === "talk") console.log(JSON.stringify({ ...(await talk()), requests, errors }));
else await wait();
await browser.close();
