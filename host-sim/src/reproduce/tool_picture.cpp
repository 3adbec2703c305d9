#include "reproduce/tool_picture.hpp"

#include <array>
#include <utility>

#include "tool/tool_proxies.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kSkinColour{0.87, 0.63, 0.50};

}  // namespace

ToolPicture tool_picture(const SceneRun& run, const std::string& title, ToolStyle style) {
    const ToolProxies& tool = run.simulation().tool();
    ToolPicture picture;
    picture.scene = run.picture(title);
    picture.scene.proxy_radius = 0.0;
    picture.tool = tool.vertices();
    picture.device = tool.goal_vertices();
    // The skin of the tool, transparent if its spheres are shown.
    PictureObject skin{
        .vertices = picture.tool, .triangles = tool.mesh().triangles, .closed = true, .colour = kSkinColour};
    skin.ghost = style == ToolStyle::Spheres;
    picture.scene.objects.push_back(std::move(skin));
    // The proxies, or the skin at the device's pose.
    if (style == ToolStyle::Spheres) {
        for (const ToolProxy& proxy : tool.particles()) {
            picture.scene.spheres.push_back({proxy.position, proxy.radius, proxy.in_contact()});
        }
    } else if (run.result().in_contact) {
        picture.scene.objects.push_back(
            {.vertices = picture.device, .triangles = tool.mesh().triangles, .closed = true, .ghost = true});
    }
    return picture;
}

}  // namespace haptic::sim::reproduce
