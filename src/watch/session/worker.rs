//! What the worker says, and what is done if it says nothing any more.

use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::Sender;
use std::time::Instant;

use serde_json::json;

use super::{CompiledKernel, Event, KERNEL, Options, Prints, Session};
use crate::watch::hub::{ToPage, packed};
use crate::watch::messages::{Frame, FromWorker, Ready, Stage, ToWorker, View};
use crate::watch::report::Report;
use crate::watch::supervisor::{Heard, Helper};
use crate::{Error, Result};

/// Workers that may end with a kernel that was good before, in a row.
const MOST_ENDS: u32 = 3;

impl Session {
    pub(super) fn hear(&mut self, heard: Heard<FromWorker>) -> Result<()> {
        self.heard = Instant::now();
        let Heard::Message(message, bytes) = heard else {
            let status = self.worker.end_status();
            if self.ready.is_none() && self.worker_number == 1 {
                return Err(start_error(status.and_then(|s| s.code())));
            }
            if self.ready_worker != self.worker_number && matches!(status.and_then(|s| s.code()), Some(2 | 3)) {
                self.wait_for_scene();
                return Ok(());
            }
            let status = status.map_or_else(|| "without a status".to_owned(), |status| status.to_string());
            return self.replace_worker(&format!("has ended ({status})"));
        };
        match message {
            FromWorker::Ready(ready) => self.worker_ready(ready)?,
            FromWorker::Building { edit } => {
                self.building = Some((edit, Instant::now()));
                self.show_status();
            }
            FromWorker::Built { edit, seconds, kernel, reused } => {
                self.building = None;
                if let Some(ready) = &mut self.ready {
                    ready.kernel = kernel;
                }
                if let Some(report) = self.report(edit) {
                    report.build_ms = seconds.map(|seconds| 1e3 * seconds);
                    report.reused = reused;
                }
                self.show_status();
            }
            FromWorker::Failed { edit, message } => {
                self.building = None;
                if let Some(report) = self.report(edit) {
                    report.fail();
                }
                self.say(&format!("edit {edit} cannot be shown: {message}"));
                self.notice = Some(message);
                self.show_status();
            }
            FromWorker::Frame(frame) => self.frame(&frame, &bytes),
            FromWorker::Stage(stage) => {
                let changed = self.stage != stage;
                self.stage = stage;
                if changed {
                    self.show_status();
                }
            }
            FromWorker::Pixel { client, x, y, radiance, samples, variance, seen, aovs } => {
                let pixel = json!({"type": "pixel", "x": x, "y": y, "radiance": radiance, "samples": samples,
                    "variance": variance, "seen": seen, "aovs": aovs});
                self.hub.reply(client, ToPage::Text(Arc::new(pixel.to_string())));
            }
            FromWorker::Prints { edit, pixel, values } => self.printed(edit, pixel, values),
            FromWorker::Saved { client, format } => {
                let name = Path::new(&self.options.scene).file_stem().map(|s| s.to_string_lossy().into_owned());
                let name = format!("{}.{format}", name.unwrap_or_else(|| "image".to_owned()));
                let json = json!({"type": "file", "name": name}).to_string();
                self.hub.reply(client, ToPage::Binary(Arc::new(packed(&json, &bytes))));
            }
        }
        Ok(())
    }

    pub(super) fn worker_ready(&mut self, ready: Ready) -> Result<()> {
        let variant_changed = self.ready.as_ref().is_none_or(|before| before.variant != ready.variant);
        if self.ready.is_none() {
            self.say(&format!("{} on {}", ready.scene, ready.device));
        }
        self.ready = Some(ready);
        self.worker.tell(ToWorker::View(Box::new(self.view.clone())), Vec::new());
        let is_new_worker = std::mem::replace(&mut self.ready_worker, self.worker_number) != self.worker_number;
        match &self.current {
            // It has loaded the scene again.
            Some(_) if !variant_changed && !is_new_worker => {}
            Some(kernel) if !variant_changed => {
                let prints = !kernel.calls.prints.is_empty();
                self.worker.tell(ToWorker::Kernel { edit: kernel.edit, prints }, kernel.spirv.to_vec());
            }
            Some(kernel) => self.compile(kernel.edit, Instant::now(), None)?,
            None => self.read_shaders(Instant::now())?,
        }
        self.show_status();
        Ok(())
    }

    pub(super) fn frame(&mut self, frame: &Frame, png: &[u8]) {
        if self.current.as_ref().is_some_and(|kernel| kernel.edit <= frame.edit) {
            self.good = self.current.clone();
            self.ends = 0;
        }
        let mut json = serde_json::to_value(frame).unwrap_or_default();
        json["type"] = json!("frame");
        self.hub.set_frame(&json.to_string(), png);
        let Some(index) = self.reports.iter().rposition(|report| report.edit == frame.edit) else { return };
        for index in 0..index {
            if self.reports[index].supersede() {
                self.say(&self.reports[index].to_string());
            }
        }
        let before = self.reports[..index].iter().rev().find(|report| report.is_measured).cloned();
        let shows_value = self.view.debug && self.current.as_ref().is_some_and(|kernel| kernel.calls.has_pixel);
        let View { camera, pose, estimator, shown, statistics, .. } = &self.view;
        // What is counted costs time: whatever adds to the kernel makes other figures.
        let view = format!("{camera} {pose:?} {estimator:?} {shows_value} {} {statistics}", shown.is_empty());
        let is_first = self.reports[index].first_image_ms.is_none();
        if self.reports[index].observe(frame, &view, before.as_ref()) {
            let line = self.reports[index].to_string();
            self.say(&line);
            self.show_status();
        } else if is_first {
            self.show_status();
        }
    }

    /// In the terminal once an edit; the page shows it for each pixel that is pinned.
    fn printed(&mut self, edit: u32, pixel: [u32; 2], values: Vec<(u32, String)>) {
        let places = self.current.as_ref().map_or(&[][..], |kernel| &kernel.calls.prints);
        let placed = |(place, value): (u32, String)| {
            let place = places.get((place as usize).checked_sub(1)?)?;
            Some((place.clone(), value))
        };
        let values: Vec<_> = values.into_iter().filter_map(placed).collect();
        let prints = Prints { edit, pixel, values };
        if self.prints.as_ref().is_none_or(|before| before.edit != edit) {
            let count = prints.values.len();
            let values = if count == 1 { "value" } else { "values" };
            self.say(&format!("pixel {},{} prints {count} {values}", pixel[0], pixel[1]));
            for (place, value) in &prints.values {
                self.say(&format!("  {}:{}: {} = {value}", place.file, place.line, place.text));
            }
        }
        self.prints = Some(prints);
        self.show_status();
    }

    fn report(&mut self, edit: u32) -> Option<&mut Report> {
        self.reports.iter_mut().rev().find(|report| report.edit == edit)
    }

    /// When the worker will have been silent, or will have built one kernel, or the compiler will have been at one, for too
    /// long.
    pub(super) fn overdue_at(&self) -> Option<Instant> {
        let silent = (self.stage == Stage::Render).then_some(self.heard);
        let building = self.building.map(|(_, since)| since);
        let since = [silent, building, self.compiler.started()].into_iter().flatten().min()?;
        Some(since + self.options.hang)
    }

    pub(super) fn overdue(&mut self) -> Result<()> {
        let seconds = self.options.hang.as_secs();
        let is_overdue = |since: Instant| since.elapsed() >= self.options.hang;
        if self.compiler.started().is_some_and(is_overdue) {
            self.compiler_failed(&format!("the compiler has been at this for {seconds} s"));
            return Ok(());
        }
        let what = if self.stage == Stage::Render && is_overdue(self.heard) { "silent" } else { "at it" };
        self.replace_worker(&format!("has been {what} for {seconds} s"))
    }

    /// Kills what is left of the worker and starts another, with the last good kernel.
    pub(super) fn replace_worker(&mut self, why: &str) -> Result<()> {
        let edit = |kernel: &Option<CompiledKernel>| kernel.as_ref().map_or(0, |kernel| kernel.edit);
        let (current, good) = (edit(&self.current), edit(&self.good));
        let does = if self.building.is_some() { "built" } else { "ran" };
        let mut message = format!("the worker {why} while it {does} {KERNEL} of edit {current}");
        if current == good {
            self.ends += 1;
            if self.ends >= MOST_ENDS {
                return Err(Error::DeviceLost(format!("{message}, {MOST_ENDS} times in a row")));
            }
            message += "; it is started again";
        } else {
            message += &format!("; it is started again with that of edit {good}");
            self.current = self.good.clone();
        }
        self.say(&message);
        self.notice = Some(message);
        self.restart_worker()
    }

    pub(super) fn restart_worker(&mut self) -> Result<()> {
        self.waits_for_scene = false;
        self.worker_number += 1;
        self.worker = start_worker(&self.options, self.worker_number, &self.events)?;
        self.stage = Stage::Load;
        self.building = None;
        self.heard = Instant::now();
        self.show_status();
        Ok(())
    }

    /// A worker that took the place of another found the scene broken, and has said why on standard error.
    fn wait_for_scene(&mut self) {
        let message =
            "the scene cannot be loaded (the terminal says why); the worker starts once one of its files is saved";
        self.say(message);
        self.notice = Some(message.to_owned());
        self.waits_for_scene = true;
        self.stage = Stage::Idle;
        self.show_status();
    }
}

pub(super) fn start_worker(options: &Options, number: u32, events: &Sender<Event>) -> Result<Helper<ToWorker>> {
    let events = events.clone();
    Helper::start(&options.worker_arguments, move |heard| {
        let _ = events.send(Event::Worker(number, heard));
    })
}

/// The worker has said why on standard error; its exit code stays.
fn start_error(code: Option<i32>) -> Error {
    let message = "the worker could not start".to_owned();
    match code {
        Some(2) => Error::Usage(message),
        Some(3) => Error::input(Path::new("watch"), message),
        Some(4) => Error::Device(message),
        _ => Error::DeviceLost(message),
    }
}
