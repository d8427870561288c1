// Opens a page in Chromium and prints what it does, as JSON.
// node page_check.mjs NODE_MODULES CHROMIUM PAGE.html ASKED.json PICTURE.png
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [modules, executablePath, page_file, asked, picture] = process.argv.slice(2);
const { chromium } = createRequire(`${modules}/`)("playwright-core");
const { frames, faces } = JSON.parse(readFileSync(asked, "utf8"));
const quiet = ["--no-sandbox", "--mute-audio", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"];
const drawn = [...quiet, "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
const open = async (args, options = {}) => {
  const browser = await chromium.launch({ executablePath, args });
  const context = await browser.newContext({ viewport: { width: 960, height: 720 }, acceptDownloads: true, ...options });
  const page = await context.newPage();
  const requests = [], errors = [];
  page.on("request", (request) => requests.push(request.url()));
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => message.type() === "error" && errors.push(message.text()));
  await page.goto(pathToFileURL(page_file).href);
  return { browser, page, requests, errors };
};
const moment = (page) => page.evaluate(() => window.facecode.moment);
const found = {};
{
  const { browser, page, requests, errors } = await open(drawn);
  found.frames = await page.evaluate(() => window.facecode.frames);
  found.positions = await page.evaluate(
    ([faces, frames]) => Array.from({ length: faces }, (_, face) => frames.map((frame) => window.facecode.positions(face, frame))),
    [faces, frames],
  );
  await page.click("#play");
  await page.waitForTimeout(500);
  const [from, at] = [await moment(page), Date.now()];
  await page.waitForTimeout(1500);
  found.rate = (await moment(page) - from) / ((Date.now() - at) / 1000);
  found.pressed = await page.getAttribute("#play", "aria-pressed");
  await page.locator("#view").focus();
  await page.keyboard.press(" ");
  const stopped = await moment(page);
  await page.waitForTimeout(300);
  found.paused = (await moment(page)) - stopped;
  await page.locator("#seek").fill(String(frames.at(-1)));
  found.sought = await moment(page);
  await page.waitForTimeout(300);
  await page.screenshot({ path: picture });
  const before = await page.locator("#view").screenshot();
  await page.locator("#view").focus();
  await page.keyboard.press("ArrowLeft");
  await page.waitForTimeout(500);
  found.turned_by_key = !before.equals(await page.locator("#view").screenshot());
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#save")]);
  found.saved = readFileSync(await download.path()).toString("base64");
  found.requests = requests.filter((url) => !url.startsWith("file:") && !url.startsWith("blob:"));
  found.errors = errors;
  await browser.close();
}
{
  const { browser, page } = await open(drawn, { viewport: { width: 390, height: 700 }, hasTouch: true, isMobile: true });
  await page.tap("#play");
  await page.waitForTimeout(700);
  found.played_by_touch = await moment(page);
  found.wider_than_the_phone = await page.evaluate(() => document.documentElement.scrollWidth > window.innerWidth);
  await page.screenshot({ path: picture.replace(".png", "-phone.png") });
  await browser.close();
}
{
  const { browser, page } = await open([...quiet, "--disable-gpu", "--disable-3d-apis"]);
  found.without_webgl = await page.textContent("#trouble");
  await browser.close();
}
console.log(JSON.stringify(found));
