//! The kernel is compiled in a process of its own: the page goes on meanwhile, and a compiler that crashes is replaced.

use std::ffi::OsString;
use std::sync::Arc;
use std::time::Instant;

use super::{CompiledKernel, Event, KERNEL, LISTED_EDITS, Session};
use crate::Result;
use crate::watch::compiler::{CompileAnswer, CompileOrder};
use crate::watch::debug_calls::{DebugCalls, number_calls};
use crate::watch::diagnostic::{Diagnostic, column_of};
use crate::watch::messages::ToWorker;
use crate::watch::report::Report;
use crate::watch::supervisor::{Heard, Helper};

/// The process, and what it is at.
pub(super) struct Compiler {
    process: Option<Helper<CompileOrder>>,
    /// Counts the processes: what an older one says does not count.
    process_number: u32,
    /// Counts the orders, likewise.
    order_number: u32,
    order: Option<Order>,
}

struct Order {
    edit: u32,
    started: Instant,
    saved: Instant,
    /// The files that changed; `None` if none did, and the kernel is compiled for another device.
    what: Option<String>,
    calls: DebugCalls,
}

impl Compiler {
    pub(super) fn new() -> Self {
        Self { process: None, process_number: 0, order_number: 0, order: None }
    }

    /// When it will have been at one kernel for too long.
    pub(super) fn started(&self) -> Option<Instant> {
        self.order.as_ref().map(|order| order.started)
    }
}

impl Session {
    /// Starts the process, if there is none; its tables are warm at the first save.
    pub(super) fn start_compiler(&mut self) -> Result<()> {
        if self.compiler.process.is_some() {
            return Ok(());
        }
        self.compiler.process_number += 1;
        let (number, events) = (self.compiler.process_number, self.events.clone());
        let heard = move |heard| {
            let _ = events.send(Event::Compiler(number, heard));
        };
        self.compiler.process = Some(Helper::start(&[OsString::from("watch-compiler")], heard)?);
        Ok(())
    }

    /// Orders the kernel for the worker's device.
    pub(super) fn compile(&mut self, edit: u32, saved: Instant, what: Option<String>) -> Result<()> {
        let Some(ready) = &self.ready else { return Ok(()) };
        let [trace, form] = ready.variant;
        self.start_compiler()?;
        self.worker.tell(ToWorker::Hold, Vec::new());
        let (sources, calls) = number_calls(&self.sources, KERNEL);
        let define = |name: &str, value: u32| (name.to_owned(), value.to_string());
        let mut defines = vec![define("TRACE_BACKEND", trace), define("ARRAY_FORM", form)];
        defines.extend((calls.has_pixel && self.view.debug).then(|| define("DEBUG_VIEW", 1)));
        defines.extend((!calls.prints.is_empty()).then(|| define("DEBUG_PRINTS", 1)));
        self.compiler.order_number += 1;
        self.compiler.order = Some(Order { edit, started: Instant::now(), saved, what, calls });
        let number = self.compiler.order_number;
        let order = CompileOrder { number, file: KERNEL.to_owned(), defines, sources };
        if let Some(process) = &self.compiler.process {
            process.tell(order, Vec::new());
        }
        Ok(())
    }

    pub(super) fn hear_compiler(&mut self, number: u32, heard: Heard<CompileAnswer>) {
        if number != self.compiler.process_number {
            return;
        }
        match heard {
            Heard::Message(answer, spirv) if answer.number == self.compiler.order_number => {
                if let Some(order) = self.compiler.order.take() {
                    self.compiled(order, answer, spirv);
                }
            }
            // A newer order is under way.
            Heard::Message(..) => {}
            Heard::Gone => {
                let status = self.compiler.process.take().map_or_else(String::new, |mut process| process.end());
                self.compiler_failed(&format!("the compiler has crashed ({status}) on this"));
            }
        }
    }

    /// The compiler is of no use any more; the next order starts another.
    pub(super) fn compiler_failed(&mut self, message: &str) {
        self.compiler.process = None;
        let Some(order) = self.compiler.order.take() else { return };
        let error = Diagnostic {
            file: KERNEL.to_owned(),
            line: 0,
            column: 0,
            message: format!("{message}: undo the last change, or change less at once"),
            source: String::new(),
            included_from: Vec::new(),
        };
        let answer = CompileAnswer { number: 0, milliseconds: 0.0, errors: vec![error] };
        self.compiled(order, answer, Vec::new());
    }

    fn compiled(&mut self, order: Order, answer: CompileAnswer, spirv: Vec<u8>) {
        let edit = order.edit;
        self.errors = answer.errors.into_iter().map(|error| self.as_written(error)).collect();
        if self.errors.is_empty() {
            self.notice = None;
            if let Some(what) = order.what {
                let mut report = Report::new(edit, what, order.saved);
                report.compile_ms = Some(answer.milliseconds);
                self.list(report);
            }
            let spirv: Arc<[u8]> = spirv.into();
            let prints = !order.calls.prints.is_empty();
            if !prints {
                self.prints = None;
            }
            self.worker.tell(ToWorker::Kernel { edit, prints }, spirv.to_vec());
            self.current = Some(CompiledKernel { edit, spirv, calls: order.calls });
        } else {
            self.worker.tell(ToWorker::Resume, Vec::new());
            let lines: Vec<_> = self.errors.iter().map(ToString::to_string).collect();
            self.say(&format!("error: {}", lines.join("\nerror: ")));
        }
        self.show_status();
    }

    /// An error at the line as its author wrote it, not as [`number_calls`] made it.
    fn as_written(&self, error: Diagnostic) -> Diagnostic {
        let line = (error.line as usize).checked_sub(1);
        let written = line.and_then(|line| self.sources.get(&error.file)?.lines().nth(line));
        match written.filter(|written| *written != error.source) {
            Some(source) => {
                Diagnostic { column: column_of(&error.message, source), source: source.to_owned(), ..error }
            }
            None => error,
        }
    }

    pub(super) fn list(&mut self, report: Report) {
        self.reports.push(report);
        if self.reports.len() > LISTED_EDITS {
            self.reports.remove(0);
        }
    }
}
