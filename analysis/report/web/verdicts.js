// Buttons of a table that choose a mission in the player.

document.querySelectorAll("[data-plays]").forEach((button) => {
  button.addEventListener("click", () => {
    const player = document.querySelector('[data-player="verdict"]');
    player.dispatchEvent(new CustomEvent("choose", { detail: button.dataset.plays }));
    player.scrollIntoView({ block: "center" });
    player.focus({ preventScroll: true });
  });
});
