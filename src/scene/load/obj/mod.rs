//! stub
pub(super) fn load(_path: &std::path::Path) -> crate::scene::SceneResult<crate::scene::Scene> {
    Ok(Default::default())
}
