//! The Vulkan instance, with the validation layer in debug builds.

use std::ffi::{CStr, c_void};
use std::sync::{Arc, Mutex};

use ash::{ext, vk};

use super::{GpuError, GpuResult};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What the validation layer has said since the last look, over all instances of the process.
static VALIDATION_MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Takes the validation layer's messages; a test that finds one fails.
pub fn take_validation_messages() -> Vec<String> {
    std::mem::take(&mut VALIDATION_MESSAGES.lock().unwrap_or_else(std::sync::PoisonError::into_inner))
}

/// Whether the Khronos validation layer is installed.
pub fn validation_is_available() -> bool {
    // SAFETY: loads the system's Vulkan loader; no Vulkan object exists yet.
    unsafe { ash::Entry::load() }.is_ok_and(|entry| has_validation_layer(&entry))
}

fn has_validation_layer(entry: &ash::Entry) -> bool {
    // SAFETY: enumerating layers has no preconditions.
    unsafe { entry.enumerate_instance_layer_properties() }.is_ok_and(|layers| {
        layers.iter().any(|layer| layer.layer_name_as_c_str().is_ok_and(|name| name == VALIDATION_LAYER))
    })
}

/// The loaded Vulkan library with its instance.
pub struct Instance {
    // Keeps the Vulkan library loaded.
    _entry: ash::Entry,
    pub(super) raw: ash::Instance,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

impl Instance {
    /// Creates the instance. Validation is on in debug builds and where `SUNFLECK_VALIDATION=1`, if the layer is there.
    ///
    /// # Errors
    /// [`GpuError::NoDriver`] without a Vulkan loader or a driver that it accepts.
    pub fn new() -> GpuResult<Arc<Self>> {
        // SAFETY: loads the system's Vulkan loader, which stays loaded as long as `entry` lives.
        let entry = unsafe { ash::Entry::load() }.map_err(|e| GpuError::NoDriver(e.to_string()))?;
        let wanted = match std::env::var("SUNFLECK_VALIDATION") {
            Ok(value) => value == "1",
            Err(_) => cfg!(debug_assertions),
        };
        let validate = wanted && has_validation_layer(&entry);
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2).application_name(c"sunfleck");
        let layers = if validate { vec![VALIDATION_LAYER.as_ptr()] } else { Vec::new() };
        let extensions = if validate { vec![ext::debug_utils::NAME.as_ptr()] } else { Vec::new() };
        let mut messenger_info = messenger_info();
        let mut info = vk::InstanceCreateInfo::default()
            .application_info(&application)
            .enabled_layer_names(&layers)
            .enabled_extension_names(&extensions);
        if validate {
            info = info.push_next(&mut messenger_info);
        }
        // SAFETY: every pointer in `info` outlives the call.
        let raw = unsafe { entry.create_instance(&info, None) }
            .map_err(|result| GpuError::NoDriver(format!("vkCreateInstance says {result}")))?;
        let messenger = validate
            .then(|| {
                let utils = ext::debug_utils::Instance::new(&entry, &raw);
                // SAFETY: the extension was enabled above.
                unsafe { utils.create_debug_utils_messenger(&self::messenger_info(), None) }.ok().map(|m| (utils, m))
            })
            .flatten();
        Ok(Arc::new(Self { _entry: entry, raw, messenger }))
    }

    /// Whether the validation layer is on.
    pub fn validates(&self) -> bool {
        self.messenger.is_some()
    }
}

fn messenger_info() -> vk::DebugUtilsMessengerCreateInfoEXT<'static> {
    use vk::DebugUtilsMessageSeverityFlagsEXT as Severity;
    use vk::DebugUtilsMessageTypeFlagsEXT as Type;
    vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Type::VALIDATION)
        .pfn_user_callback(Some(on_message))
}

unsafe extern "system" fn on_message(
    _severity: vk::DebugUtilsMessageSeverityFlagsEXT,
    _types: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _user: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: the layer passes a valid structure whose message is a C string.
    let message = unsafe { (*data).message_as_c_str() };
    let text = message.map_or_else(String::new, |m| m.to_string_lossy().into_owned());
    tracing::error!("validation: {text}");
    VALIDATION_MESSAGES.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(text);
    vk::FALSE
}

impl Drop for Instance {
    fn drop(&mut self) {
        // SAFETY: devices hold an Arc of this instance, so nothing made from it is left.
        unsafe {
            if let Some((utils, messenger)) = &self.messenger {
                utils.destroy_debug_utils_messenger(*messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}
