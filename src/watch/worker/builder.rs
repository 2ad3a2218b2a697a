//! Builds kernels in a thread of its own, so that the old kernel renders on meanwhile.
//!
//! There are two tracers, in front the one that renders, and behind it the one that the next kernel is built in; then they
//! change places. On CPU devices each has a device of its own ([`OpenDevice::for_building`]).

use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};

use super::Incoming;
use super::loaded::{LoadScene, Loaded, Loader, camera_of};
use crate::Result;
use crate::gpu::Gpu;
use crate::render::{BindingOverride, KernelKey, OpenDevice, OtherScene, PathTracer, SceneBuffers, Settings};
use crate::watch::messages::View;

/// What is to be built.
#[derive(Clone)]
pub(super) struct Wanted {
    pub(super) edit: u32,
    pub(super) settings: Settings,
    pub(super) view: View,
    /// The kernel was compiled with DEBUG_PRINTS.
    pub(super) prints: bool,
    /// Load the scene anew.
    pub(super) reload: bool,
}

/// The tracer that renders, and where.
pub(super) struct Front {
    pub(super) loaded: Arc<Loaded>,
    pub(super) tracer: PathTracer,
    pub(super) settings: Settings,
    /// Its kernel prints.
    pub(super) prints: bool,
}

/// What came of an order; `Err` has the tracer back, which is as it was.
pub(super) struct Outcome {
    pub(super) wanted: Wanted,
    pub(super) built: Result<Built>,
    /// Of a scene that was loaded again, what of it was made anew.
    pub(super) reused: Option<String>,
    /// The tracer behind, if nothing was built in it.
    pub(super) behind: Option<PathTracer>,
}

/// What takes the place of what is in front.
pub(super) enum Built {
    /// Another kernel.
    Kernel(Box<Front>),
    /// A scene for the kernel in front.
    Scene(Arc<Loaded>, Box<OtherScene>),
}

struct Order {
    wanted: Wanted,
    /// Of the kernel in front, if it is made from the shader that is wanted.
    key: Option<KernelKey>,
    gpu: Arc<Gpu>,
    loaded: Arc<Loaded>,
    buffers: Arc<SceneBuffers>,
    behind: Option<PathTracer>,
}

/// The thread, and the two devices.
pub(super) struct Builder {
    orders: Sender<Order>,
    device: OpenDevice,
    /// Of the tracer in front, and of that behind.
    gpus: [Arc<Gpu>; 2],
    behind: Option<PathTracer>,
    /// The edit that is being built.
    in_work: Option<u32>,
    /// What is to be built next; newer orders take its place.
    next: Option<Wanted>,
}

/// Slices so short that a message, or a compiler that wants the processor, is not kept waiting.
pub(super) const BINDING: BindingOverride = BindingOverride {
    array_form: None,
    workgroup_size: None,
    slice_atoms: None,
    slice_time: Some(std::time::Duration::from_millis(10)),
    ray_budget: None,
    driver_specializes: false,
};

impl Builder {
    /// Loads the scene, builds its first kernel, and starts the thread, which says what it built into `done`.
    pub(super) fn start(
        device: OpenDevice,
        wanted: &Wanted,
        load: LoadScene,
        done: Sender<Incoming>,
    ) -> Result<(Self, Front)> {
        let loader = Loader::new(load);
        let (loaded, _) = loader.load(&wanted.settings, &wanted.view)?;
        let front = new_front(&device, &device.gpu, Arc::new(loaded), wanted)?;
        // Where a second device is refused, kernels are built on the first, and keep it busy if its driver does so.
        let second = device.for_building().unwrap_or_else(|_| Arc::clone(&device.gpu));
        let (orders, inbox) = channel::<Order>();
        let (trace, reason) = (device.trace, device.reason.clone());
        std::thread::spawn(move || {
            while let Ok(order) = inbox.recv() {
                let open = OpenDevice { gpu: Arc::clone(&order.gpu), trace, reason: reason.clone() };
                if done.send(Incoming::Built(Box::new(build(&open, order, &loader)))).is_err() {
                    return;
                }
            }
        });
        let gpus = [Arc::clone(&device.gpu), second];
        Ok((Self { orders, device, gpus, behind: None, in_work: None, next: None }, front))
    }

    /// Builds this next, behind what is in front.
    pub(super) fn order(&mut self, wanted: Wanted, front: &Front) {
        let reload = wanted.reload || self.next.as_ref().is_some_and(|next| next.reload);
        self.next = Some(Wanted { reload, ..wanted });
        self.go_on(front);
    }

    fn go_on(&mut self, front: &Front) {
        if self.in_work.is_some() {
            return;
        }
        let Some(wanted) = self.next.take() else { return };
        let edit = wanted.edit;
        let (gpu, loaded) = (Arc::clone(&self.gpus[1]), Arc::clone(&front.loaded));
        let buffers = Arc::clone(front.tracer.buffers());
        let is_same_shader = wanted.settings.kernel_spirv == front.settings.kernel_spirv;
        let key = is_same_shader.then(|| *front.tracer.key());
        let order = Order { wanted, key, gpu, loaded, buffers, behind: self.behind.take() };
        self.in_work = self.orders.send(order).is_ok().then_some(edit);
    }

    /// Takes what was built to the front. `Err` is why nothing was.
    pub(super) fn take(&mut self, outcome: Outcome, front: &mut Front) -> Result<()> {
        self.in_work = None;
        self.behind = outcome.behind;
        let result = outcome.built.and_then(|built| self.change(built, outcome.wanted, front));
        self.go_on(front);
        result
    }

    fn change(&mut self, built: Built, wanted: Wanted, front: &mut Front) -> Result<()> {
        // Of a scene that is no longer shown, nothing is kept.
        match built {
            Built::Kernel(built) => {
                let old = std::mem::replace(front, *built);
                self.behind = Arc::ptr_eq(&old.loaded, &front.loaded).then_some(old.tracer);
                self.gpus.swap(0, 1);
            }
            Built::Scene(loaded, scene) => {
                front.tracer.take_scene(*scene)?;
                (front.loaded, front.settings, front.prints) = (loaded, wanted.settings, wanted.prints);
                self.behind = None;
            }
        }
        Ok(())
    }

    /// Why this device, and which driver.
    pub(super) fn device(&self) -> String {
        format!("{}, {}", self.device.reason, self.device.gpu.info.driver)
    }

    /// The edit that is being built.
    pub(super) fn in_work(&self) -> Option<u32> {
        self.in_work
    }
}

fn new_front(device: &OpenDevice, gpu: &Arc<Gpu>, loaded: Arc<Loaded>, wanted: &Wanted) -> Result<Front> {
    let camera = camera_of(&loaded.scene, &wanted.view)?;
    let tracer = PathTracer::new(gpu, device.trace, &loaded.prepared, &camera, &wanted.settings, BINDING)?;
    Ok(Front { loaded, tracer, settings: wanted.settings.clone(), prints: wanted.prints })
}

fn build(device: &OpenDevice, order: Order, loader: &Loader) -> Outcome {
    if order.wanted.reload {
        let (built, reused) = match reload(device, &order, loader) {
            Ok((built, reused)) => (Ok(built), Some(reused)),
            Err(error) => (Err(error), None),
        };
        return Outcome { wanted: order.wanted, built, reused, behind: order.behind };
    }
    let Order { wanted, gpu, loaded, buffers, behind, .. } = order;
    let reused = None;
    let camera = match camera_of(&loaded.scene, &wanted.view) {
        Ok(camera) => camera,
        Err(error) => return Outcome { wanted, built: Err(error), reused, behind },
    };
    let (settings, prints) = (wanted.settings.clone(), wanted.prints);
    let front = |tracer| Built::Kernel(Box::new(Front { loaded: Arc::clone(&loaded), tracer, settings, prints }));
    let Some(mut tracer) = behind else {
        let tracer = PathTracer::beside(&buffers, &gpu, &loaded.prepared, &camera, &wanted.settings, BINDING);
        return Outcome { built: tracer.map(front), wanted, reused, behind: None };
    };
    match tracer.rebuild(&loaded.prepared, &camera, &wanted.settings) {
        Ok(()) => Outcome { wanted, built: Ok(front(tracer)), reused, behind: None },
        Err(error) => Outcome { wanted, built: Err(error), reused, behind: Some(tracer) },
    }
}

/// The scene anew: for the kernel in front, if it takes the same, else with a kernel of its own.
fn reload(device: &OpenDevice, order: &Order, loader: &Loader) -> Result<(Built, String)> {
    let Order { wanted, key, buffers, .. } = order;
    let (loaded, reused) = loader.load(&wanted.settings, &wanted.view)?;
    let camera = camera_of(&loaded.scene, &wanted.view)?;
    let upload = |key| OtherScene::upload(key, buffers, &loaded.prepared, &camera, &wanted.settings, BINDING);
    match key.as_ref().map(upload).transpose()?.flatten() {
        Some(scene) => Ok((Built::Scene(Arc::new(loaded), Box::new(scene)), format!("{reused}, kernel kept"))),
        None => Ok((Built::Kernel(Box::new(new_front(device, &order.gpu, Arc::new(loaded), wanted)?)), reused)),
    }
}
